// A message type is one file: this one adds a toy type in the way of src/input/message_types, and finds it wherever
// types are asked for.
#include "input/message_type.h"

#include <gtest/gtest.h>
#include <std_msgs/Float64MultiArray.h>
#include <algorithm>
#include <boost/make_shared.hpp>

#include "config/monitor_config.h"
#include "input/mesh_decoder.h"
#include "input/object_views.h"
#include "ros/support/bytes_of.h"

namespace dccd {
namespace {

using std_msgs::Float64MultiArray;

IndexedView read(WireReader& wire, const std::string&) {
  if (wire.readCount("layout.dim", 12) != 0) throw WireError("layout.dim is not empty");
  wire.skip(4, "layout.data_offset");
  const WireSpan<double> data = wire.readArray<double>("data");
  IndexedView mesh;
  mesh.points = {data.data, data.size / 3};
  return mesh;
}

IndexedView view(const Float64MultiArray& message, const std::string&) {
  IndexedView mesh;
  mesh.points = {reinterpret_cast<const std::uint8_t*>(message.data.data()), message.data.size() / 3};
  return mesh;
}

const MeshTypeRegistration TOY(meshType<Float64MultiArray, read, view>("toy"));

constexpr const char* TOY_TYPE = "std_msgs/Float64MultiArray";

MeshInputConfig gridInWorld() {
  MeshInputConfig config;
  config.rows = config.cols = 2;
  config.frame_id = "world";
  return config;
}

boost::shared_ptr<const Float64MultiArray> square() {
  auto message = boost::make_shared<Float64MultiArray>();
  message->data = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0.5};
  return message;
}

TEST(MessageType, AToyIsDecodedFromBytesAndAsAnObject) {
  const MeshType& type = *findMeshType(TOY_TYPE);
  const auto message = square();
  const std::vector<std::uint8_t> bytes = test::bytesOf(*message);
  MeshDecoder decoder(gridInWorld());
  const DecodedMesh from_bytes = decoder.decode(TOY_TYPE, {bytes.data(), bytes.size()});
  const DecodedMesh from_object = decoder.decode(TOY_TYPE, {}, {&type, message});
  EXPECT_EQ(from_bytes.positions.at(3), Vec3(1, 1, 0.5));
  EXPECT_EQ(from_bytes.positions, from_object.positions);
  EXPECT_EQ(from_bytes.topology, from_object.topology);
  EXPECT_THROW(decoder.decode(TOY_TYPE, {bytes.data(), bytes.size() - 1}), MeshError);
}

TEST(MessageType, AToyIsNamedWhereverTypesAre) {
  EXPECT_EQ(meshTypeProblem(TOY_TYPE, findMeshType(TOY_TYPE)->md5), "");
  EXPECT_NE(meshTypeProblem(TOY_TYPE, "0").find("built with different definitions"), std::string::npos);
  EXPECT_NE(meshTypeProblem("std_msgs/Bool", "*").find(TOY_TYPE), std::string::npos);
  XmlRpc::XmlRpcValue tree;
  tree["type"] = "toy";
  EXPECT_EQ(readConfig(tree).bodies.at(0).input.type, "toy");
}

// The one of Fuerte has no DELETEALL: another md5, and the same bytes.
TEST(MessageType, AnOlderDefinitionOfTheSameLayoutIsRead) {
  for (const char* type : {"visualization_msgs/Marker", "visualization_msgs/MarkerArray"}) {
    std::string older = findMeshType(type)->definition;
    const std::size_t at = older.find("uint8 DELETEALL=3");
    ASSERT_NE(at, std::string::npos);
    older.erase(at, older.find('\n', at) - at);
    EXPECT_EQ(meshTypeProblem(type, "18326976df9d29249efc939e00342cde", older), "");
    EXPECT_NE(meshTypeProblem(type, "18326976df9d29249efc939e00342cde"), "") << "unknown";
    std::string other = older;
    other.replace(other.find("duration lifetime"), 17, "float64 lifetime");
    EXPECT_NE(meshTypeProblem(type, "0", other).find("lifetime' is known"), std::string::npos)
        << meshTypeProblem(type, "0", other);
    EXPECT_NE(meshTypeProblem(type, "0", "uint8 X=1\n"), "") << "no field";
    EXPECT_NE(meshTypeProblem(type, "0", "MSG: a/b\na/b b\n"), "") << "one that goes round";
  }
  EXPECT_NE(meshTypeProblem("shape_msgs/Mesh", "0", "shape_msgs/Mesh m\n"), "") << "one that goes round";
}

TEST(MessageType, OfAnObjectOfAnotherTypeThereIsNone) {
  const auto message = square();
  const TypedMesh typed{findMeshType(TOY_TYPE), message};
  EXPECT_EQ(typed.as<Float64MultiArray>(), message.get());
  EXPECT_EQ(typed.as<std_msgs::Header>(), nullptr);
}

TEST(MessageType, TheStampIsReadWhereTheTypeHasIt) {
  // seq, secs, nsecs, an empty frame_id, and in an array the number of markers before them.
  const std::vector<std::uint8_t> header{0, 0, 0, 0, 5, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0};
  EXPECT_EQ(stampOf("sensor_msgs/PointCloud2", header), 5000000007);
  EXPECT_EQ(stampOf("shape_msgs/Mesh", header), 0) << "has none";
  EXPECT_EQ(stampOf("std_msgs/Bool", header), 0) << "is no mesh";
  EXPECT_EQ(stampOf("sensor_msgs/PointCloud2", {0, 0, 0, 0, 5}), 0) << "cut off";
  std::vector<std::uint8_t> array(220, 0);  // the count, the header, the rest of the marker
  array[0] = 1;
  std::copy(header.begin(), header.end(), array.begin() + 4);
  EXPECT_EQ(stampOf("visualization_msgs/MarkerArray", array), 5000000007);
  EXPECT_EQ(stampOf("visualization_msgs/MarkerArray", {0, 0, 0, 0}), 0) << "no marker";
}

}  // namespace
}  // namespace dccd
