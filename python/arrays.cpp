#include "arrays.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace dccd {
namespace python {

namespace {

constexpr double ROTATION_ERROR = 1e-6;  // of a pose's rows, from a rotation's: float32 and printed digits pass

std::string textOf(py::handle value) { return py::cast<std::string>(py::str(value)); }

/// "(n, 3)".
std::string textOf(const std::vector<py::ssize_t>& shape) {
  std::string text;
  for (const py::ssize_t n : shape) text += (text.empty() ? "" : ", ") + (n == ANY ? "n" : std::to_string(n));
  return "(" + text + (shape.size() == 1 ? ",)" : ")");
}

py::array checkedArray(py::handle value, const std::string& name, const char* kinds, const std::string& wanted) {
  // An array is also what lies under a mask, which is nobody's number.
  if (py::hasattr(value, "mask") && py::module_::import("numpy.ma").attr("is_masked")(value).cast<bool>()) {
    throw py::value_error(name + " has masked elements; filled(numpy.nan) makes them positions that are not known");
  }
  py::array array = py::array::ensure(value);
  if (!array) throw py::type_error(name + " is no array; " + wanted);
  // An empty list is float64 to numpy, whatever it is a list of.
  const bool untyped = array.size() == 0 && !py::isinstance<py::array>(value);
  if (!untyped && (!std::strchr(kinds, array.dtype().kind()) || array.itemsize() > 8)) {
    throw py::type_error(name + " has dtype " + textOf(array.dtype()) + "; " + wanted);
  }
  return array;
}

void checkShape(const py::array& array, const std::string& name, const std::vector<py::ssize_t>& shape) {
  bool fits = array.ndim() == static_cast<py::ssize_t>(shape.size());
  for (std::size_t i = 0; fits && i < shape.size(); ++i) fits = shape[i] == ANY || shape[i] == array.shape(i);
  if (fits) return;
  throw py::value_error(name + " has shape " + textOf(py::handle(array.attr("shape"))) + ", expected " + textOf(shape));
}

/// "t0[3, 1]", of the element at this place in C order.
std::string placeOf(const py::array& array, const std::string& name, py::ssize_t at) {
  std::string text;
  for (py::ssize_t axis = array.ndim() - 1; axis >= 0; --axis) {
    text = std::to_string(at % array.shape(axis)) + (text.empty() ? "" : ", ") + text;
    at /= array.shape(axis);
  }
  return name + "[" + text + "]";
}

}  // namespace

Doubles doublesOf(py::handle value, const std::string& name, const std::vector<py::ssize_t>& shape) {
  const py::array array = checkedArray(value, name, "fiu", "expected real numbers (float64 is taken as it is)");
  checkShape(array, name, shape);
  return Doubles(array);
}

Integers integersOf(py::handle value, const std::string& name, const std::vector<py::ssize_t>& shape,
                    std::int64_t most) {
  const py::array array = checkedArray(value, name, "iu", "expected integers");
  // Where nothing is in it, its shape says nothing.
  if (array.size() > 0) checkShape(array, name, shape);
  const Integers wide(array);
  for (py::ssize_t i = 0; i < wide.size(); ++i) {
    const std::int64_t index = wide.data()[i];
    if (index >= 0 && index <= most) continue;
    throw py::value_error(placeOf(wide, name, i) + " is " + std::to_string(index) + "; expected 0 to " +
                          std::to_string(most));
  }
  return wide;
}

std::shared_ptr<const Positions> positionsOf(py::handle value, const std::string& name) {
  const auto array = doublesOf(value, name, {ANY, 3});
  static_assert(sizeof(Vec3) == 3 * sizeof(double));
  auto positions = std::make_shared<Positions>(static_cast<std::size_t>(array.shape(0)));
  if (array.size() > 0) std::memcpy(static_cast<void*>(positions->data()), array.data(), array.nbytes());
  return positions;
}

std::vector<Index> verticesOf(py::handle value, const std::string& name) {
  const auto array = integersOf(value, name, {ANY}, NO_INDEX - 1);
  return std::vector<Index>(array.data(), array.data() + array.size());
}

Eigen::Isometry3d poseOf(py::handle value, const std::string& name) {
  const auto array = doublesOf(value, name, {4, 4});
  Eigen::Isometry3d pose;
  pose.matrix() = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.data());
  const Eigen::Matrix3d turn = pose.linear();
  const bool turns = (turn * turn.transpose()).isIdentity(ROTATION_ERROR) && turn.determinant() > 0;
  if (!turns || !pose.translation().allFinite() || pose.matrix().row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    throw py::value_error(name + " is no pose; expected a rotation, a translation and the row 0 0 0 1");
  }
  return pose;
}

py::array readOnly(const py::dtype& dtype, std::vector<py::ssize_t> shape, const void* data, py::handle owner) {
  py::array view(dtype, std::move(shape), data, owner);
  py::detail::array_proxy(view.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return view;
}

py::object arrayOf(const std::shared_ptr<const Positions>& positions) {
  if (!positions) return py::none();
  return sharedArray(positions, py::dtype::of<double>(), {static_cast<py::ssize_t>(positions->size()), 3});
}

py::array matrixOf(const Eigen::Isometry3d& pose) {
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = pose.matrix();
  return py::array_t<double>({4, 4}, rows.data());
}

py::dtype structured(std::vector<Field> fields, std::size_t bytes) {
  std::sort(fields.begin(), fields.end(), [](const Field& a, const Field& b) { return a.offset < b.offset; });
  py::list names, formats, offsets;
  for (const Field& field : fields) {
    names.append(field.name);
    formats.append(field.format);
    offsets.append(field.offset);
  }
  py::dict description;
  description["names"] = names;
  description["formats"] = formats;
  description["offsets"] = offsets;
  description["itemsize"] = bytes;
  return py::dtype::from_args(description);
}

}  // namespace python
}  // namespace dccd
