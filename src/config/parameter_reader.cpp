#include "config/parameter_reader.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

namespace dccd {

using XmlRpc::XmlRpcValue;

namespace {

std::size_t editDistance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

const char* typeName(XmlRpcValue& value) {
  switch (value.getType()) {
    case XmlRpcValue::TypeBoolean:
      return "a boolean";
    case XmlRpcValue::TypeInt:
      return "an integer";
    case XmlRpcValue::TypeDouble:
      return "a number";
    case XmlRpcValue::TypeString:
      return "a string";
    case XmlRpcValue::TypeArray:
      return "a list";
    case XmlRpcValue::TypeStruct:
      return "a section";
    default:
      return "of a type that is not used here";
  }
}

std::string text(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

}  // namespace

std::string nearestName(const std::string& name, const std::vector<std::string>& known) {
  std::string best;
  std::size_t least = std::numeric_limits<std::size_t>::max();
  for (const std::string& candidate : known) {
    const std::size_t distance = editDistance(name, candidate);
    if (distance < least) least = distance, best = candidate;
  }
  return best;
}

ParameterReader::ParameterReader(XmlRpcValue tree, std::string path) : tree_(std::move(tree)), path_(std::move(path)) {
  if (tree_.valid() && tree_.getType() != XmlRpcValue::TypeStruct) {
    throw ParameterError("parameter " + path_ + " is " + typeName(tree_) + ", a section is needed");
  }
}

void ParameterReader::fail(const std::string& name, const std::string& what) const {
  throw ParameterError("parameter " + path_ + name + " " + what);
}

XmlRpcValue ParameterReader::raw(const std::string& name) {
  known_.insert(name);
  return tree_.valid() && tree_.hasMember(name) ? tree_[name] : XmlRpcValue();
}

bool ParameterReader::has(const std::string& name) { return raw(name).valid(); }

double ParameterReader::number(const std::string& name, double fallback, double min, double max) {
  XmlRpcValue value = raw(name);
  if (!value.valid()) return fallback;
  double result = 0;
  if (value.getType() == XmlRpcValue::TypeDouble) {
    result = static_cast<double>(value);
  } else if (value.getType() == XmlRpcValue::TypeInt) {
    result = static_cast<int>(value);
  } else {
    // YAML takes 1e-6 for text; only 1.0e-6 is a number there.
    fail(name, std::string("is ") + typeName(value) + ", a number is needed" +
                   (value.getType() == XmlRpcValue::TypeString ? " (in YAML write 1.0e-6, not 1e-6)" : ""));
  }
  if (!(result >= min && result <= max)) {
    fail(name, "is " + text(result) + ", it must be from " + text(min) + " to " + text(max));
  }
  return result;
}

int ParameterReader::integer(const std::string& name, int fallback, int min, int max) {
  XmlRpcValue value = raw(name);
  if (!value.valid()) return fallback;
  if (value.getType() != XmlRpcValue::TypeInt) {
    fail(name, std::string("is ") + typeName(value) + ", an integer is needed");
  }
  const int result = static_cast<int>(value);
  if (result < min || result > max) {
    fail(name,
         "is " + std::to_string(result) + ", it must be from " + std::to_string(min) + " to " + std::to_string(max));
  }
  return result;
}

bool ParameterReader::get(const std::string& name, bool fallback) {
  XmlRpcValue value = raw(name);
  if (!value.valid()) return fallback;
  if (value.getType() != XmlRpcValue::TypeBoolean) {
    fail(name, std::string("is ") + typeName(value) + ", true or false is needed");
  }
  return static_cast<bool>(value);
}

std::string ParameterReader::get(const std::string& name, const std::string& fallback) {
  XmlRpcValue value = raw(name);
  if (!value.valid()) return fallback;
  if (value.getType() != XmlRpcValue::TypeString) {
    fail(name, std::string("is ") + typeName(value) + ", a string is needed");
  }
  return static_cast<std::string>(value);
}

std::string ParameterReader::choice(const std::string& name, const std::string& fallback,
                                    const std::vector<std::string>& choices) {
  XmlRpcValue value = raw(name);
  if (!value.valid()) return fallback;
  std::string text;
  if (value.getType() == XmlRpcValue::TypeBoolean)
    text = static_cast<bool>(value) ? "on" : "off";
  else
    text = get(name, fallback);
  if (std::find(choices.begin(), choices.end(), text) != choices.end()) return text;
  std::string all;
  for (const std::string& one : choices) all += (all.empty() ? "" : ", ") + one;
  fail(name, "is '" + text + "', it must be one of " + all + "; nearest is '" + nearestName(text, choices) + "'");
}

std::vector<double> ParameterReader::numbers(XmlRpcValue& list, const std::string& name, std::size_t count) const {
  if (list.getType() != XmlRpcValue::TypeArray || list.size() != static_cast<int>(count)) {
    fail(name, "must hold lists of " + std::to_string(count) + " numbers");
  }
  std::vector<double> result;
  for (int i = 0; i < list.size(); ++i) {
    if (list[i].getType() == XmlRpcValue::TypeDouble)
      result.push_back(static_cast<double>(list[i]));
    else if (list[i].getType() == XmlRpcValue::TypeInt)
      result.push_back(static_cast<int>(list[i]));
    else
      fail(name, std::string("holds ") + typeName(list[i]) + " where a number is needed");
    if (!std::isfinite(result.back())) fail(name, "holds a number that is not finite");
  }
  return result;
}

std::vector<XmlRpcValue> ParameterReader::list(const std::string& name) {
  XmlRpcValue value = raw(name);
  std::vector<XmlRpcValue> items;
  if (!value.valid()) return items;
  if (value.getType() != XmlRpcValue::TypeArray) {
    fail(name, std::string("is ") + typeName(value) + ", a list is needed");
  }
  for (int i = 0; i < value.size(); ++i) items.push_back(value[i]);
  return items;
}

std::vector<unsigned> ParameterReader::indices(const std::string& name) {
  std::vector<unsigned> result;
  for (XmlRpcValue& item : list(name)) {
    if (item.getType() != XmlRpcValue::TypeInt || static_cast<int>(item) < 0) {
      fail(name, "must hold vertex indices, integers from 0");
    }
    result.push_back(static_cast<unsigned>(static_cast<int>(item)));
  }
  return result;
}

ParameterReader ParameterReader::section(const std::string& name) { return {raw(name), path_ + name + "/"}; }

std::vector<std::string> ParameterReader::names() {
  std::vector<std::string> result;
  if (!tree_.valid()) return result;
  for (auto& member : tree_) result.push_back(member.first);
  return result;
}

void ParameterReader::finish() {
  for (const std::string& name : names()) {
    if (known_.count(name)) continue;
    fail(name, "is not known; nearest is " + path_ +
                   nearestName(name, std::vector<std::string>(known_.begin(), known_.end())));
  }
}

}  // namespace dccd
