// Numpy arrays into the core's types and back. What does not fit is a TypeError (a dtype) or a ValueError (a shape, a
// value) that names the argument.
#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "dccd/types.h"

namespace dccd {
namespace python {

namespace py = pybind11;

constexpr py::ssize_t ANY = -1;

using Doubles = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Integers = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

/// Real numbers of this shape (ANY: any length), in C order: the array itself where it is that already.
Doubles doublesOf(py::handle value, const std::string& name, const std::vector<py::ssize_t>& shape);
/// The same of integers from 0 to `most`.
Integers integersOf(py::handle value, const std::string& name, const std::vector<py::ssize_t>& shape,
                    std::int64_t most);

std::shared_ptr<const Positions> positionsOf(py::handle value, const std::string& name);
std::vector<Index> verticesOf(py::handle value, const std::string& name);
/// 4 x 4, a rotation and a translation.
Eigen::Isometry3d poseOf(py::handle value, const std::string& name);

/// A view that nobody can write to, of memory that `owner` keeps.
py::array readOnly(const py::dtype& dtype, std::vector<py::ssize_t> shape, const void* data, py::handle owner);
/// The same, of an array that is shared.
template <class T>
py::array sharedArray(const std::shared_ptr<const std::vector<T>>& values, const py::dtype& dtype,
                      std::vector<py::ssize_t> shape) {
  using Shared = std::shared_ptr<const std::vector<T>>;
  const py::capsule owner(new Shared(values), [](void* shared) { delete static_cast<Shared*>(shared); });
  return readOnly(dtype, std::move(shape), values->data(), owner);
}
py::object arrayOf(const std::shared_ptr<const Positions>& positions);  ///< None: there are none
py::array matrixOf(const Eigen::Isometry3d& pose);

/// A field of a structured dtype: numpy's name of its format, and where it lies. In this order numpy can save it.
struct Field {
  const char* name;
  const char* format;
  std::size_t offset;
};
py::dtype structured(std::vector<Field> fields, std::size_t bytes);

/// *made, which the first who asks makes; it is never freed: at exit that would come after the interpreter's end. No
/// static local of C++: to make it may let another Python thread in, which would wait for the static's guard and keep
/// the interpreter's lock, for ever.
template <class T, class Make>
const T& onceMade(const T*& made, const Make& make) {
  if (!made) {
    const auto* const mine = new T(make());
    if (!made) made = mine;  // another thread may have been faster; both are equal
  }
  return *made;
}

}  // namespace python
}  // namespace dccd
