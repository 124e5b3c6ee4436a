// From a URDF to meshes in the links' frames: every feature by hand-computed vertices, and what is wrong is named.
#include "robot/robot_model.h"

#include <filesystem>
#include <fstream>

#include "robot_texts.h"
#include "support/closed_meshes.h"
#include "support/folder_test.h"
#include "unit/ros/stl_text.h"

namespace dccd {
namespace test {
namespace {

namespace fs = std::filesystem;

std::string ours(const std::string& name) {
  return "file://" DEFORMABLE_CCD_SOURCE_DIR "/test/unit/ros/meshes/" + name;
}

bool hasVertex(const RobotPart& part, const Vec3& expected, double error_m) {
  const Positions& all = part.mesh->positions;
  return std::any_of(all.begin(), all.end(), [&](const Vec3& p) { return (p - expected).norm() <= error_m; });
}

/// Six times the volume, above 0 where the faces look outwards.
double volume(const MeshResource& mesh) {
  double sum = 0;
  for (const Face& f : mesh.topology->faces()) {
    sum += mesh.positions[f[0]].dot(mesh.positions[f[1]].cross(mesh.positions[f[2]]));
  }
  return sum;
}

class RobotModel : public FolderTest {
 protected:
  std::string write(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return "file://" + (folder_ / name).string();
  }
  /// A tetrahedron whose corners are the origin and 1, 2, 3 along the axes.
  std::string tetrahedron(const std::string& name) {
    return write(name, stlText(test::tetrahedron({0, 0, 0}, {0, 2, 0}, {1, 0, 0}, {0, 0, 3})));
  }
};

TEST_F(RobotModel, EveryGeometryIsWhereTheLinkHasIt) {
  const std::string stl = tetrahedron("t.STL");
  const std::string turned = "<origin xyz='1 2 3' rpy='0 0 1.5707963267948966'/>";
  const std::string rolled = "<origin xyz='0 0 1' rpy='1.5707963267948966 0 0'/>";
  const Robot robot = robotFrom(
      robotOf(link("box", collision("<box size='0.2 0.4 0.6'/>", turned)) +
              link("cylinder", collision("<cylinder radius='0.5' length='2'/>", rolled)) +
              link("sphere", collision("<sphere radius='0.25'/>", turned)) +
              link("stl", collision("<mesh filename='" + stl + "' scale='2 1 0.5'/>", turned)) +
              link("mirrored", collision("<mesh filename='" + stl + "' scale='-1 1 1'/>")) +
              link("dae", collision("<mesh filename='" + ours("pyramid_mm.dae") + "' scale='1 2 3'/>", turned)) +
              link("obj", collision("<mesh filename='" + ours("pyramid.obj") + "'/>")) +
              joint("box", "cylinder", "continuous") +
              joint("box", "sphere", "revolute", "<limit effort='1' velocity='1' lower='-1' upper='1'/>") +
              joint("box", "stl", "prismatic", "<mimic joint='box_sphere'/>") + joint("stl", "mirrored", "floating") +
              joint("stl", "dae", "planar") + joint("stl", "obj")));
  EXPECT_EQ(joinedText(robot.missing), "");
  EXPECT_EQ(robot.links.size(), 7u);
  ASSERT_EQ(robot.parts.size(), 7u);
  // (x, y, z) goes to (1 - y, 2 + x, 3 + z).
  for (const Vec3& corner : {Vec3(1.2, 1.9, 2.7), Vec3(0.8, 2.1, 3.3), Vec3(1.2, 2.1, 3.3)}) {
    EXPECT_TRUE(hasVertex(partOf(robot, "box"), corner, 1e-15)) << corner.transpose();
  }
  // (x, y, z) goes to (x, -z, 1 + y); 50 sides keep 0.5 m within 1 mm, and corner 0 lies on the x axis.
  const double corner_m = 0.5 / std::cos(M_PI / 50);
  ASSERT_EQ(partOf(robot, "cylinder").mesh->positions.size(), 100u);
  for (const Vec3& corner : {Vec3(corner_m, 1, 1), Vec3(corner_m, -1, 1), Vec3(-corner_m, 1, 1)}) {
    EXPECT_TRUE(hasVertex(partOf(robot, "cylinder"), corner, 1e-9)) << corner.transpose();
  }
  Eigen::AlignedBox3d bounds;
  for (const Vec3& p : partOf(robot, "sphere").mesh->positions) {
    bounds.extend(p);
    EXPECT_GT((p - Vec3(1, 2, 3)).norm(), 0.25);
    EXPECT_LE((p - Vec3(1, 2, 3)).norm(), 0.251);
  }
  EXPECT_LT((bounds.center() - Vec3(1, 2, 3)).norm(), 1e-9);
  for (const Vec3& corner : {Vec3(1, 4, 3), Vec3(-1, 2, 3), Vec3(1, 2, 4.5)}) {
    EXPECT_TRUE(hasVertex(partOf(robot, "stl"), corner, 1e-15)) << corner.transpose();
  }
  for (const Vec3& corner : {Vec3(-1, 0, 0), Vec3(0, 2, 0), Vec3(0, 0, 3)}) {
    EXPECT_TRUE(hasVertex(partOf(robot, "mirrored"), corner, 0)) << corner.transpose();
  }
  EXPECT_GT(volume(*partOf(robot, "stl").mesh), 0);
  EXPECT_GT(volume(*partOf(robot, "mirrored").mesh), 0) << "a mirrored mesh is not turned inside out";
  // Of the pyramid: (0.2, 0.1, 0.01), (0, 0, 0.06), (0.2, 0, 0.01).
  for (const Vec3& corner : {Vec3(0.8, 2.2, 3.03), Vec3(1, 2, 3.18), Vec3(1, 2.2, 3.03)}) {
    EXPECT_TRUE(hasVertex(partOf(robot, "dae"), corner, 1e-15)) << corner.transpose();
  }
  for (const Vec3& corner : {Vec3(0.2, 0.1, 0.01), Vec3(0, 0, 0.06), Vec3(0.2, 0, 0.01)}) {
    EXPECT_TRUE(hasVertex(partOf(robot, "obj"), corner, 0)) << corner.transpose();
  }
}

// About the link's origin it would take the element away from where it is.
TEST_F(RobotModel, ScaleIsAboutTheElementsMiddleAndTheToleranceIsThatOfTheResult) {
  const std::string urdf = robotOf(link("a", collision("<box size='2 2 2'/>", "<origin xyz='3 0 0'/>")) +
                                   link("b", collision("<cylinder radius='0.5' length='2'/>")) + joint("a", "b"));
  RobotConfig config;
  config.scale = 0.5;
  config.links["b"].scale = 4.0;
  const Robot robot = robotFrom(urdf, "", config);
  EXPECT_TRUE(hasVertex(partOf(robot, "a"), Vec3(3.5, 0.5, 0.5), 0));
  EXPECT_TRUE(hasVertex(partOf(robot, "a"), Vec3(2.5, -0.5, 0.5), 0));
  EXPECT_EQ(robot.excluded, std::vector<std::string>{"link 'a' but for a scale of 0.5"});
  EXPECT_EQ(partOf(robot, "b").mesh->positions.size(), 2 * 100u) << "a radius of 2 m within 1 mm";
}

TEST_F(RobotModel, EachElementOfALinkIsABodyOfItsOwn) {
  const Robot robot = robotFrom(
      robotOf(link("a", collision("<sphere radius='1'/>") + collision("<box size='1 1 1'/>") +
                            collision("<capsule radius='1' length='1'/>") + collision("<box size='2 2 2'/>"))));
  ASSERT_EQ(robot.parts.size(), 3u);
  EXPECT_EQ(robot.parts[1].name, "a/2");
  EXPECT_EQ(robot.parts[2].name, "a/3");
  for (const RobotPart& part : robot.parts) EXPECT_EQ(part.link, "a");
  EXPECT_TRUE(says(robot.missing,
                   "link 'a' is not watched: its collision element 3 (line 1) is a capsule, which URDF "
                   "readers before urdfdom 5.1 do not know; write a cylinder and two spheres"))
      << joinedText(robot.missing);
}

// Other people's robots: what moves them, how they look and what simulates them is not this package's matter.
TEST_F(RobotModel, WhatOthersWriteBesideSurfacesIsPassedOver) {
  const Robot robot = robotFrom(
      "<?xml version='1.0'?>\n<!-- autogenerated by xacro -->\n<robot name='r' xmlns:xacro='http://wiki.ros.org/xacro'>"
      "<material name='grey'><color rgba='1 1 1 1'/></material><material name='grey'><color rgba='0 0 0 1'/></material>"
      "<link name='world'/><!-- base -->"
      "<link name='base'><inertial><mass value='x'/></inertial><visual><geometry><capsule/></geometry>"
      "<material name='nobody'/></visual><collision name='c'><geometry><box size='1 1 "
      "1'/></geometry></collision></link>"
      "<link name='seen'><visual><geometry><mesh filename='package://none/v.dae'/></geometry></visual></link>"
      "<joint name='fix' type='fixed'><parent link='world'/><child link='base'/></joint>"
      "<joint name='turn' type='revolute'><parent link='base'/><child link='seen'/><axis xyz='0 0 x'/></joint>"
      "<transmission name='t'><type>x</type></transmission><gazebo reference='base'><x/></gazebo></robot>");
  EXPECT_EQ(joinedText(robot.missing), "");
  ASSERT_EQ(robot.parts.size(), 1u);
  EXPECT_EQ(robot.parts[0].name, "base");
  EXPECT_EQ(
      joinedText(robot.hints),
      "not watched, for they have a visual but no collision element (robot/visuals: true takes the visual): links "
      "'seen'\n"
      "without geometry are links 'world'\n");
  EXPECT_EQ(joinedText(robot.excluded),
            "links 'seen': they have a visual but no collision element (robot/visuals: true takes the visual)\n");
}

TEST_F(RobotModel, AMarkBesideAShapeIsNoShape) {
  const std::string mark = "<drake:declare_convex/>", mesh = "<mesh filename='" + ours("pyramid.obj") + "'/>";
  for (const std::string& geometry : {mesh + mark, mark + mesh}) {
    const Robot robot = robotFrom(robotOf(link("a", collision(geometry))));
    EXPECT_EQ(joinedText(robot.missing), "") << geometry;
    EXPECT_EQ(robot.parts.size(), 1u) << geometry;
  }
  const Robot two = robotFrom(robotOf(link("a", collision(mesh + "<drake:capsule radius='1' length='1'/>"))));
  EXPECT_TRUE(says(two.missing, "has more than one shape")) << "one that has a size is no mark";
  EXPECT_TRUE(says(robotFrom(robotOf(link("a", collision(mark)))).missing, "has no geometry"));
}

// A controller's spheres for the robot against itself are none of what a cloth may touch.
TEST_F(RobotModel, ShapesOfSelfCollisionCheckingAreNoneOfTheLinks) {
  const std::string spheres =
      "<self_collision_checking><origin xyz='0 0 0'/><geometry><sphere "
      "radius='9'/></geometry></self_collision_checking>";
  const Robot robot = robotFrom(robotOf(link("a", collision("<box size='1 1 1'/>") + spheres)));
  EXPECT_EQ(joinedText(robot.missing), "");
  ASSERT_EQ(robot.parts.size(), 1u);
}

TEST_F(RobotModel, ASphereOfRadiusZeroIsLeftOutByName) {
  const Robot robot = robotFrom(
      robotOf(link("a", collision("<sphere radius='0'/>")) +
              link("b", collision("<box size='1 1 1'/>") + collision("<sphere radius='0'/>")) + joint("a", "b")));
  EXPECT_EQ(joinedText(robot.missing), "");
  EXPECT_EQ(joinedText(robot.excluded),
            "link 'a', a sphere of radius 0\nlink 'b', collision element 2, a sphere of radius 0\n");
  EXPECT_EQ(robot.parts.size(), 1u);
}

// Where it is asked for, and only of a link that has nothing else.
TEST_F(RobotModel, AVisualStandsForACollisionElement) {
  RobotConfig config;
  config.visuals = true;
  const std::string visual =
      "<visual><origin xyz='1 0 0'/><geometry><box size='2 2 2'/></geometry><material name='m'/></visual>";
  const Robot robot =
      robotFrom(robotOf(link("seen", visual + visual) + link("both", visual + collision("<box size='1 1 1'/>")) +
                        joint("seen", "both")),
                "", config);
  EXPECT_EQ(joinedText(robot.missing) + joinedText(robot.hints), "");
  ASSERT_EQ(robot.parts.size(), 3u);
  EXPECT_TRUE(hasVertex(partOf(robot, "seen/2"), Vec3(2, 1, 1), 1e-15));
  EXPECT_TRUE(hasVertex(partOf(robot, "both"), Vec3(0.5, 0.5, 0.5), 0));
}

TEST_F(RobotModel, WhatCannotBeReadIsNamedAndTheRestHolds) {
  const std::string flat = write("flat.stl", "solid t\nendsolid t\n");
  const std::pair<std::string, const char*> cases[] = {
      {"<mesh filename='package://no_such_package/a.stl'/>", "there is no package 'no_such_package'"},
      {"<mesh filename='/no/such/file.stl'/>", "/no/such/file.stl"},
      {"<mesh filename='" + flat + "'/>", "flat.stl"},
      {"<mesh filename='/a.stl' scale='1 0 1'/>", "the scale of its mesh /a.stl is 0"},
      {"<box size='1 0 1'/>", "a side of its box is 0 m; it must be above 0"},
      {"<cylinder radius='-1' length='1'/>", "the radius of its cylinder is -1 m"},
      {"<sphere radius='-1'/>", "the radius of its sphere is -1 m"},
      {"<cone radius='1'/>", "is <cone>, which is no geometry"},
  };
  for (const auto& [geometry, expected] : cases) {
    const Robot robot = robotFrom(robotOf(link("bad", collision(geometry)) +
                                          link("good", collision("<box size='1 1 1'/>")) + joint("good", "bad")));
    EXPECT_TRUE(robot.known);
    ASSERT_EQ(robot.parts.size(), 1u) << geometry;
    EXPECT_EQ(robot.parts[0].name, "good");
    ASSERT_EQ(robot.missing.size(), 1u) << geometry;
    EXPECT_TRUE(says(robot.missing, "link 'bad'")) << robot.missing[0];
    EXPECT_TRUE(says(robot.missing, expected)) << robot.missing[0];
  }
}

// Nothing is passed over that may be a surface: what is left out of the model is missing.
TEST_F(RobotModel, ShapesThatWouldNotBeReadAreMissing) {
  const std::string box = "<geometry><box size='1 1 1'/></geometry>", far = "<origin xyz='9 9 9'/>";
  const std::pair<std::string, const char*> cases[] = {
      {link("bad", collision("<sphere radius='1'/><box size='1 1 1'/>")),
       "link 'bad' is not watched: its collision element 1 (line 1) has more than one shape"},
      {link("bad", "<collision>" + box + box + "</collision>"), "has more than one <geometry>"},
      {link("bad", collision("<box size='1 1 1'/>", far + far)), "has more than one <origin>"},
      {link("bad", "<Collision>" + box + "</Collision>"),
       "not watched: a <geometry> in <Collision> of line 1, where no URDF has one"},
      {link("bad", "<parts><collision>" + box + "</collision></parts>"), "not watched: a <geometry> in <collision>"},
      {link("bad", "") + "<Link name='c'><collision>" + box + "</collision></Link>", "a <geometry> in <collision>"},
      {link("bad", "") + "<group>" + link("c", collision("<box size='1 1 1'/>")) + "</group>",
       "in <collision> of line"},
  };
  for (const auto& [bad, expected] : cases) {
    const Robot robot = robotFrom(robotOf(bad + link("good", collision("<box size='1 1 1'/>")) + joint("good", "bad")));
    ASSERT_EQ(robot.parts.size(), 1u) << bad;
    ASSERT_EQ(robot.missing.size(), 1u) << bad;
    EXPECT_TRUE(says(robot.missing, expected)) << robot.missing[0];
  }
  const std::string sensor = "<gazebo reference='good'><visual>" + box + "</visual></gazebo>";
  EXPECT_EQ(joinedText(robotFrom(robotOf(link("good", collision("<box size='1 1 1'/>")) + sensor)).missing), "");
}

TEST_F(RobotModel, WhatWaitsForXacroIsNoRobot) {
  for (const std::string waits :
       {"<xacro:include filename='arm.xacro'/>", "<xacro:if value='1'><link name='b'/></xacro:if>"}) {
    const Robot robot = robotFrom(robotOf(link("a", collision("<box size='1 1 1'/>") + waits)));
    EXPECT_FALSE(robot.known);
    EXPECT_TRUE(says(robot.missing, "of line 1, so that xacro has not expanded it yet")) << joinedText(robot.missing);
  }
}

// What urdfdom passes over would be where it is not.
TEST_F(RobotModel, AnOriginByQuaternionIsRefused) {
  const std::string box = "<box size='1 1 1'/>";
  const Robot robot =
      robotFrom(robotOf(link("a", collision(box, "<origin xyz='0 0 1' quat_xyzw='0 0 1 0'/>") + collision(box))));
  EXPECT_EQ(robot.parts.size(), 1u);
  EXPECT_TRUE(says(robot.missing,
                   "link 'a' is not watched: its collision element 1 (line 1) has an origin with quat_xyzw, which URDF "
                   "readers before urdfdom 5.1 pass over; write rpy"))
      << joinedText(robot.missing);
}

TEST_F(RobotModel, APlaceInTheWordsOfSdfIsRefused) {
  const std::string box = "<box size='1 1 1'/>", pose = "<pose>0 0 0.5 0 1.57 0</pose>";
  const Robot robot = robotFrom(robotOf(link("a", collision(box, pose) + collision(box))));
  EXPECT_EQ(robot.parts.size(), 1u);
  EXPECT_TRUE(says(robot.missing, "link 'a' is not watched: its collision element 1 (line 1) has a <pose>"))
      << joinedText(robot.missing);
}

// As RViz, which asks for a file's address.
TEST_F(RobotModel, AnAddressMayHaveEscapes) {
  tetrahedron("a b.stl");
  tetrahedron("c%20d.stl");
  const auto mesh = [&](const std::string& name) {
    return collision("<mesh filename='file://" + (folder_ / name).string() + "'/>");
  };
  const Robot robot = robotFrom(robotOf(link("a", mesh("a%20b.stl") + mesh("a b.stl") + mesh("c%20d.stl"))));
  EXPECT_EQ(joinedText(robot.missing), "");
  EXPECT_EQ(robot.parts.size(), 3u);
  EXPECT_TRUE(says(robotFrom(robotOf(link("a", mesh("no%2")))).missing, "no%2"));
}

// urdfdom reads no further in a link then, and goes on with the next one.
TEST_F(RobotModel, AnElementThatTheReaderRefusesIsNamed) {
  const std::string good = collision("<box size='1 1 1'/>");
  for (const char* bad : {"<box size='1 x 1'/>", "<box/>", "<sphere radius='big'/>", "<mesh/>"}) {
    const Robot robot = robotFrom(robotOf(link("a", good + collision(bad) + good) + link("b", good) + joint("a", "b")));
    EXPECT_EQ(robot.parts.size(), 2u);
    ASSERT_EQ(robot.missing.size(), 1u) << bad;
    EXPECT_TRUE(says(robot.missing, "link 'a' is not watched: of its 3 collision elements 1 could be read: "))
        << robot.missing[0];
  }
  const Robot moved = robotFrom(robotOf(link("a", collision("<sphere radius='1'/>", "<origin xyz='0 0'/>"))));
  EXPECT_TRUE(moved.parts.empty());
  EXPECT_TRUE(says(moved.missing, "link 'a' is not watched: of its 1 collision elements 0 could be read: "));
}

TEST_F(RobotModel, ATextThatIsNoUrdfIsNamedWithItsPlace) {
  const std::pair<std::string, const char*> cases[] = {
      {"<robot name='a'>\n<link name='b'>\n</robot>", "test.urdf is no XML: XML_ERROR_MISMATCHED_ELEMENT in line"},
      {"", "test.urdf is no XML: XML_ERROR_EMPTY_DOCUMENT"},
      {"\n<COLLADA/>", "test.urdf begins with <COLLADA> of line 2, where <robot> is needed"},
      {"<robot name='a'/>\n<robot name='b'/>", "test.urdf goes on with <robot> of line 2 behind the end of <robot>"},
      {robotOf("<link/>"), "test.urdf <link> of line 1 needs the attribute name"},
      {robotOf(""), "test.urdf No link elements found"},
      {robotOf(link("a", "") + link("a", "")), "link 'a' is not unique"},
      {robotOf(link("a", "") + link("b", "")), "Two root links found: [a] and [b]"},
      {robotOf(link("a", "") + joint("a", "c")), "child link [c] of joint [a_c] not found"},
  };
  for (const auto& [text, expected] : cases) {
    const Robot robot = robotFrom(text);
    EXPECT_FALSE(robot.known) << text;
    ASSERT_EQ(robot.missing.size(), 1u) << text;
    EXPECT_EQ(robot.missing[0].find("nothing of the robot is watched: "), 0u);
    EXPECT_TRUE(says(robot.missing, expected)) << robot.missing[0];
  }
  EXPECT_TRUE(says(makeRobot({"parameter /r", "", "was set by nobody"}, {}, {}, 1e-3).missing,
                   "nothing of the robot is watched: parameter /r was set by nobody"));
  EXPECT_TRUE(says(robotFrom(robotOf(link("a", ""))).missing, "no link with a collision element"));
}

TEST_F(RobotModel, AMeshInMillimetresIsHintedAt) {
  const std::string urdf =
      robotOf(link("a", collision("<mesh filename='" + tetrahedron("t.stl") + "' scale='9 9 9'/>")));
  EXPECT_TRUE(says(robotFrom(urdf).hints,
                   "link 'a' is 33.6749 m across: if its mesh is in millimetres, write "
                   "scale=\"0.001 0.001 0.001\" beside its filename"))
      << joinedText(robotFrom(urdf).hints);
  EXPECT_EQ(robotFrom(urdf).doubts, robotFrom(urdf).hints);
}

TEST_F(RobotModel, WhatIsLeftOutIsNotRead) {
  RobotConfig config;
  config.leave_out = {"a", "group two"};
  const std::string gone = collision("<mesh filename='/no/such/file.stl'/>");
  const Robot robot =
      robotFrom(robotOf(link("a", gone) + link("b", gone) + link("c", collision("<box size='1 1 1'/>")) +
                        joint("a", "b") + joint("b", "c")),
                robotOf("<group name='two'><link name='b'/></group>"), config);
  EXPECT_EQ(joinedText(robot.missing), "");
  EXPECT_EQ(robot.left_out, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(robot.parts.size(), 1u);
  // Nor are shapes that stand where no URDF has one, which the owner would be told to correct.
  const std::string odd = "<Collision><geometry><box size='1 1 1'/></geometry></Collision>";
  config.leave_out = {"a"};
  const std::string urdf = robotOf(link("a", odd) + link("c", collision("<box size='1 1 1'/>")) + joint("a", "c"));
  EXPECT_EQ(joinedText(robotFrom(urdf, "", config).missing), "");
  EXPECT_TRUE(says(robotFrom(urdf).missing, "a <geometry> in <Collision>"));
}

}  // namespace
}  // namespace test
}  // namespace dccd
