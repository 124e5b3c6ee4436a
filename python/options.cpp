// The options of a step by their names: those of Options in dccd/detect.h.
#include <cmath>
#include <limits>

#include "module.h"

namespace dccd {
namespace python {

namespace {

using Bodies = std::vector<Body>;

/// An option: how it is set from Python, and told.
struct Row {
  const char* name;
  std::function<void(Options&, py::handle, const Bodies&)> set;
  std::function<py::object(const Options&, const Bodies&)> get;
};

[[noreturn]] void refuseType(const std::string& name, py::handle value, const std::string& wanted) {
  throw py::type_error(name + " is " + py::cast<std::string>(py::repr(value)) + "; expected " + wanted);
}

template <class T>
void read(py::handle value, const std::string& name, T& out) {
  try {
    out = value.cast<T>();
  } catch (const py::cast_error&) {
    if constexpr (std::is_same_v<T, bool>) {
      refuseType(name, value, "True or False");
    } else if constexpr (std::is_floating_point_v<T>) {
      refuseType(name, value, "a number");
    } else if constexpr (std::is_integral_v<T>) {
      // So that math.inf is a limit that nothing reaches.
      const bool infinite = py::isinstance<py::float_>(value) && value.cast<double>() == HUGE_VAL;
      if (!infinite && py::isinstance<py::int_>(value)) {
        throw py::value_error(name + " is " + py::cast<std::string>(py::repr(value)) + ", which is out of range");
      }
      if (!infinite) refuseType(name, value, "an integer");
      out = std::numeric_limits<T>::max();
    } else {
      refuseType(name, value, "a list of str");
    }
  }
}

/// A plain field; `fieldOf` gives a reference to it.
template <class FieldOf>
Row plain(const char* name, FieldOf fieldOf) {
  return {name, [name, fieldOf](Options& o, py::handle value, const Bodies&) { read(value, name, fieldOf(o)); },
          [fieldOf](const Options& o, const Bodies&) { return py::cast(fieldOf(o)); }};
}

std::string choiceOf(py::handle value, const std::string& name) {
  if (!py::isinstance<py::str>(value)) refuseType(name, value, "a str");
  return value.cast<std::string>();
}

void setExcludeBoxes(Options& options, py::handle value, const Bodies&) {
  const Doubles boxes = doublesOf(value, "exclude_boxes", {ANY, 2, 3});
  options.exclude_boxes.assign(static_cast<std::size_t>(boxes.shape(0)), Box());
  const double* at = boxes.data();
  for (Box& box : options.exclude_boxes) {
    box.min = Vec3(at[0], at[1], at[2]);
    box.max = Vec3(at[3], at[4], at[5]);
    at += 6;
  }
}

py::object getExcludeBoxes(const Options& options, const Bodies&) {
  py::array_t<double> boxes({static_cast<py::ssize_t>(options.exclude_boxes.size()), py::ssize_t{2}, py::ssize_t{3}});
  double* at = boxes.mutable_data();
  for (const Box& box : options.exclude_boxes) {
    for (const Vec3* corner : {&box.min, &box.max}) at = std::copy(corner->data(), corner->data() + 3, at);
  }
  return std::move(boxes);
}

/// {'between': [ONE, OTHER], 'vertices': {NAME: indices}}, as expected_contacts of doc/interface.md.
Expectation expectationOf(py::handle value, const std::string& name, const Bodies& bodies) {
  if (!py::isinstance<py::dict>(value)) refuseType(name, value, "a dict with 'between', as ['cloth', 'octomap']");
  const py::dict given = py::reinterpret_borrow<py::dict>(value);
  Expectation expectation;
  py::dict vertices;
  std::vector<std::string> between;
  for (const auto& [key, item] : given) {
    const std::string word = py::str(key);
    if (word == "between") {
      read(item, name + "['between']", between);
    } else if (word == "vertices" && py::isinstance<py::dict>(item)) {
      vertices = py::reinterpret_borrow<py::dict>(item);
    } else {
      throw py::value_error(name + ": '" + word + "' is neither 'between' nor a dict 'vertices'");
    }
  }
  if (between.size() != 2) throw py::value_error(name + "['between'] has to name two, as ['cloth', 'octomap']");
  for (std::size_t side = 0; side < 2; ++side) {
    const std::string& who = between[side];
    const bool itself = who == SELF_NAME;
    ExpectedPartner& partner = expectation.partners[side];
    partner.body = bodyNamed(itself ? between[1 - side] : who, bodies);
    // Vertices under its name alone stand for both sides of a body with itself.
    const char* key = itself && !vertices.contains(who) ? between[1 - side].c_str() : who.c_str();
    if (vertices.contains(key)) partner.vertices = verticesOf(vertices[key], name + "['vertices']['" + key + "']");
  }
  return expectation;
}

void setExpected(Options& options, py::handle value, const Bodies& bodies) {
  if (!py::isinstance<py::sequence>(value) || py::isinstance<py::str>(value)) {
    refuseType("expected", value, "a list of dicts");
  }
  options.expected.clear();
  for (const py::handle item : value) {
    const std::string name = "expected[" + std::to_string(options.expected.size()) + "]";
    options.expected.push_back(expectationOf(item, name, bodies));
  }
}

py::object getExpected(const Options& options, const Bodies& bodies) {
  py::list expected;
  for (const Expectation& expectation : options.expected) {
    py::list between;
    py::dict vertices, entry;
    for (const ExpectedPartner& partner : expectation.partners) {
      const bool itself = between.size() == 1 && expectation.partners[0].body == partner.body;
      const std::string who = itself                          ? SELF_NAME
                              : partner.body == OBSTACLE_BODY ? MAP_NAME
                                                              : bodies.at(partner.body).name;
      between.append(who);
      // An empty list: anywhere. Without it those of the first side would stand for both.
      const bool anywhere = itself && !expectation.partners[0].vertices.empty();
      if (anywhere || !partner.vertices.empty()) vertices[py::str(who)] = partner.vertices;
    }
    entry["between"] = between;
    if (!vertices.empty()) entry["vertices"] = vertices;
    expected.append(entry);
  }
  return std::move(expected);
}

const std::vector<Row>& rows() {
#define DCCD_PLAIN(name) \
  plain(                 \
      #name, [](auto& o) -> auto& { return o.name; })
#define DCCD_ACCURACY(name) \
  plain(                    \
      #name, [](auto& o) -> auto& { return o.accuracy.name; })
#define DCCD_CLEARANCE(name, member) \
  plain(                             \
      name, [](auto& o) -> auto& { return o.clearance.member; })
  static const std::vector<Row> ROWS = {
      {"accuracy",
       [](Options& o, py::handle value, const Bodies&) {
         o.accuracy.rung = accuracyFromString(choiceOf(value, "accuracy").c_str());
       },
       [](const Options& o, const Bodies&) { return py::object(py::str(toString(o.accuracy.rung))); }},
      DCCD_ACCURACY(tolerance_m),
      DCCD_ACCURACY(toc_bits),
      DCCD_ACCURACY(max_subdivisions),
      DCCD_PLAIN(num_threads),
      DCCD_PLAIN(step_budget_ms),
      DCCD_PLAIN(max_compute_ms),
      DCCD_PLAIN(earliest_only),
      DCCD_PLAIN(check_start_state),
      DCCD_PLAIN(keep_bounds),
      DCCD_PLAIN(unfolded_test),
      DCCD_PLAIN(rigid_tolerance_m),
      DCCD_PLAIN(max_substeps),
      DCCD_PLAIN(max_contacts),
      DCCD_PLAIN(max_found),
      DCCD_PLAIN(max_found_per_feature),
      DCCD_PLAIN(suppress_initial),
      {"exclude_boxes", setExcludeBoxes, getExcludeBoxes},
      DCCD_PLAIN(obstacle_expected),
      {"expected", setExpected, getExpected},
      DCCD_PLAIN(patches),
      DCCD_CLEARANCE("clearance", wanted),
      DCCD_CLEARANCE("clearance_tolerance_m", tolerance_m),
      DCCD_CLEARANCE("clearance_max_m", max_m),
      DCCD_CLEARANCE("clearance_self_m", self_m),
      DCCD_PLAIN(excluded)};
#undef DCCD_CLEARANCE
#undef DCCD_PLAIN
#undef DCCD_ACCURACY
  return ROWS;
}

}  // namespace

double numberOf(py::handle value, const std::string& name) {
  double number = 0;
  read(value, name, number);
  return number;
}

bool setOption(const std::string& name, py::handle value, const Bodies& bodies, Options& options) {
  for (const Row& row : rows()) {
    if (name != row.name) continue;
    row.set(options, value, bodies);
    return true;
  }
  return false;
}

void refuseOption(const std::string& name) {
  if (py::hasattr(py::type::of<NamedBody>(), name.c_str())) {
    throw py::type_error("'" + name + "' is no option of a call but of a body: dccd.Body(..., " + name + "=...)");
  }
  std::string known;
  for (const Row& row : rows()) known += (known.empty() ? "" : ", ") + std::string(row.name);
  throw py::type_error("there is no option '" + name + "'; there are " + known);
}

void refuseBodyOption(const std::string& name) {
  for (const Row& row : rows()) {
    if (name != row.name) continue;
    throw py::type_error("'" + name + "' is no option of a body but of a call: dccd.detect(..., " + name + "=...)");
  }
  throw py::type_error("a body has no option '" + name + "'; help(dccd.Body) names all");
}

void setOptions(const py::dict& values, const Bodies& bodies, Options& options) {
  for (const auto& [key, value] : values) {
    const std::string name = py::str(key);
    if (!setOption(name, value, bodies, options)) refuseOption(name);
  }
}

py::dict optionsOf(const Options& options, const Bodies& bodies) {
  py::dict values;
  for (const Row& row : rows()) values[row.name] = row.get(options, bodies);
  return values;
}

}  // namespace python
}  // namespace dccd
