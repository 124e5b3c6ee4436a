// Parameters from a tree of XML-RPC values (the parameter server's, or a YAML file's), strictly: an unknown name or a
// wrong type is an error that names the parameter and what was probably meant.
#pragma once

#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <xmlrpcpp/XmlRpcValue.h>

namespace dccd {

struct ParameterError : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

/// The known name nearest to `name` by edit distance; empty when there is none.
std::string nearestName(const std::string& name, const std::vector<std::string>& known);

/// One level of the tree. Every get marks its name as known; finish() refuses what nobody asked for.
class ParameterReader {
 public:
  /// `tree` may be invalid (no parameters at all). `path` leads messages, for example "~" or "~bodies/cloth/".
  /// Throws ParameterError when it is neither a struct nor empty.
  ParameterReader(XmlRpc::XmlRpcValue tree, std::string path);

  bool has(const std::string& name);
  /// Numbers in [min, max].
  double number(const std::string& name, double fallback, double min, double max);
  int integer(const std::string& name, int fallback, int min, int max);
  bool get(const std::string& name, bool fallback);
  std::string get(const std::string& name, const std::string& fallback);
  /// One of the choices. YAML's on and off are booleans, so those are taken for the words where these are choices.
  std::string choice(const std::string& name, const std::string& fallback, const std::vector<std::string>& choices);
  std::vector<double> numbers(XmlRpc::XmlRpcValue& list, const std::string& name, std::size_t count) const;
  /// The list's items, or none when it is not set.
  std::vector<XmlRpc::XmlRpcValue> list(const std::string& name);
  std::vector<unsigned> indices(const std::string& name);
  ParameterReader section(const std::string& name);
  /// Names set at this level.
  std::vector<std::string> names();
  /// The value of a known name, marked as asked for; invalid when not set.
  XmlRpc::XmlRpcValue raw(const std::string& name);
  const std::string& path() const { return path_; }

  /// Throws ParameterError on the first name that is set but that no get asked for.
  void finish();
  [[noreturn]] void fail(const std::string& name, const std::string& what) const;

 private:
  XmlRpc::XmlRpcValue tree_;
  std::string path_;
  std::set<std::string> known_;
};

}  // namespace dccd
