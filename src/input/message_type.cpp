#include "input/message_type.h"

#include <algorithm>

#include "input/message_layout.h"

namespace dccd {

namespace {

/// As the files of message_types/ register them, in whatever order the linker has them start.
std::vector<MeshType>& registered() {
  static std::vector<MeshType> rows;
  return rows;
}

std::vector<MeshType> inOrder(std::vector<MeshType> rows) {
  std::sort(rows.begin(), rows.end(),
            [](const MeshType& a, const MeshType& b) { return std::string(a.datatype) < b.datatype; });
  return rows;
}

/// "a, b or c".
std::string anyOf(const std::vector<MeshType>& types) {
  std::string text;
  for (std::size_t i = 0; i < types.size(); ++i) {
    text += i == 0 ? "" : i + 1 < types.size() ? ", " : " or ";
    text += types[i].datatype;
  }
  return text;
}

}  // namespace

MeshTypeRegistration::MeshTypeRegistration(const MeshType& row) { registered().push_back(row); }

const std::vector<MeshType>& meshTypes() {
  static const std::vector<MeshType> TYPES = inOrder(registered());
  return TYPES;
}

const MeshType* findMeshType(const std::string& datatype) {
  for (const MeshType& type : meshTypes()) {
    if (datatype == type.datatype) return &type;
  }
  return nullptr;
}

const MeshType* findMeshTypeNamed(const std::string& name) {
  for (const MeshType& type : meshTypes()) {
    if (name == type.name) return &type;
  }
  return nullptr;
}

std::string md5Problem(const std::string& datatype, const std::string& md5, const std::string& known) {
  if (md5 == known || md5 == "*") return {};
  return "type " + datatype + " has md5 " + md5 + ", known is " + known +
         ": publisher and monitor were built with different definitions";
}

std::string meshTypeProblem(const std::string& datatype, const std::string& md5, const std::string& definition) {
  const MeshType* type = findMeshType(datatype);
  if (type) {
    const std::string problem = md5Problem(datatype, md5, type->md5);
    if (problem.empty() || definition.empty()) return problem;
    const std::string difference = layoutDifference(datatype, definition, type->definition);
    return difference.empty() ? "" : problem + ": " + difference;
  }
  return "type " + datatype + " is not a mesh; publish " + anyOf(meshTypes());
}

StampNs stampOf(const std::string& datatype, const std::vector<std::uint8_t>& bytes) {
  const MeshType* type = findMeshType(datatype);
  if (!type) return 0;
  try {
    WireReader wire(bytes.data(), bytes.size());
    return type->readHeader(wire).stamp_ns;
  } catch (const WireError&) {
    return 0;  // whoever decodes the message says what is wrong
  }
}

}  // namespace dccd
