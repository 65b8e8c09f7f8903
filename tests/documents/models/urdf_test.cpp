// Robots' files: where their links stand against kinematics in double, what they look like, and what is wrong with
// them.
#include <array>
#include <cmath>
#include <fstream>
#include <random>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/field_path.h>
#include <rtsg/core/placement.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"
#include "documents/import/imported.h"
#include "support/temp_folder.h"

namespace rtsg {
namespace {

using test::Imported;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// ---- kinematics in double, which knows nothing of the scene -----------------------------------------------------

struct Frame {
    double m[3][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}};
};

Frame operator*(const Frame& a, const Frame& b) {
    Frame c;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 4; ++j) {
            c.m[i][j] = j == 3 ? a.m[i][3] : 0;
            for (int k = 0; k < 3; ++k) c.m[i][j] += a.m[i][k] * b.m[k][j];
        }
    return c;
}

/// Rodrigues; `axis` is of length 1.
Frame turned(const std::array<double, 3>& axis, double angle) {
    const double c = std::cos(angle), s = std::sin(angle), x = axis[0], y = axis[1], z = axis[2];
    return {{{c + x * x * (1 - c), x * y * (1 - c) - z * s, x * z * (1 - c) + y * s, 0},
             {y * x * (1 - c) + z * s, c + y * y * (1 - c), y * z * (1 - c) - x * s, 0},
             {z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c), 0}}};
}

Frame moved(const std::array<double, 3>& distance) {
    Frame f;
    for (int i = 0; i < 3; ++i) f.m[i][3] = distance[static_cast<std::size_t>(i)];
    return f;
}

/// A robot with joints of all kinds, as text and as numbers.
struct RandomRobot {
    struct Joint {
        std::string kind;
        int parent = 0;
        std::array<double, 3> xyz{}, rpy{}, axis{};
        double lower = 0, upper = 0, value = 0, multiplier = 1, offset = 0;
        int mimics = -1;

        bool hasValue() const { return kind == "revolute" || kind == "continuous" || kind == "prismatic"; }
        double clamped(double wanted) const {
            return kind == "continuous" ? wanted : std::min(std::max(wanted, lower), upper);
        }
    };

    RandomRobot(unsigned seed, int count) : dice_(seed) {
        constexpr const char* kinds[] = {"revolute", "revolute", "continuous", "prismatic", "fixed", "floating"};
        for (int i = 0; i < count; ++i) {
            Joint joint;
            joint.kind = kinds[dice_() % 6];
            joint.parent = i < 3 ? i : static_cast<int>(dice_() % static_cast<unsigned>(i + 1));
            for (double& one : joint.xyz) one = real(-1, 1);
            for (double& one : joint.rpy) one = real(-3.2, 3.2);
            double length = 0;
            for (double& one : joint.axis) {
                one = real(-1, 1);
                length += one * one;
            }
            for (double& one : joint.axis) one /= std::sqrt(length);
            joint.lower = real(-6.3, .3);
            joint.upper = std::max(joint.lower + .01, real(-.3, 6.3));
            if (joint.hasValue() && i > 0 && dice_() % 4 == 0) {
                const int leader = static_cast<int>(dice_() % static_cast<unsigned>(i));
                if (joints[static_cast<std::size_t>(leader)].hasValue()) joint.mimics = leader;
                joint.multiplier = real(-2, 2);
                joint.offset = real(-1, 1);
            }
            joints.push_back(joint);
        }
    }
    /// Values within the limits and beyond them; of those that mimic, as these follow.
    void move() {
        for (Joint& joint : joints) {
            joint.value = joint.kind == "continuous" ? real(-20, 20) : real(-8, 8);
            if (joint.mimics < 0) continue;
            const Joint& leader = joints[static_cast<std::size_t>(joint.mimics)];
            joint.value = leader.clamped(leader.value) * joint.multiplier + joint.offset;
        }
    }
    std::string text() const {
        std::string all = "<robot name='dice'><link name='l0'/>";
        for (std::size_t i = 0; i < joints.size(); ++i) {
            const Joint& j = joints[i];
            all += fmt::format(
                "<link name='l{0}'/><joint name='j{0}' type='{1}'><parent link='l{2}'/><child link='l{0}'/>", i + 1,
                j.kind, j.parent);
            all += fmt::format("<origin xyz='{} {} {}' rpy='{} {} {}'/>", j.xyz[0], j.xyz[1], j.xyz[2], j.rpy[0],
                               j.rpy[1], j.rpy[2]);
            all += fmt::format("<axis xyz='{} {} {}'/>", 2 * j.axis[0], 2 * j.axis[1], 2 * j.axis[2]);
            all += fmt::format("<limit lower='{}' upper='{}' effort='1' velocity='1'/>", j.lower, j.upper);
            if (j.mimics >= 0)
                all += fmt::format("<mimic joint='j{}' multiplier='{}' offset='{}'/>", j.mimics + 1, j.multiplier,
                                   j.offset);
            all += "</joint>";
        }
        return all + "</robot>";
    }
    /// Where link `number` is in the scene's frame, where y points up.
    Frame link(int number) const {
        if (number == 0) return turned({1, 0, 0}, -std::acos(0));
        const Joint& j = joints[static_cast<std::size_t>(number - 1)];
        Frame f = link(j.parent) * moved(j.xyz) * turned({0, 0, 1}, j.rpy[2]) * turned({0, 1, 0}, j.rpy[1]) *
                  turned({1, 0, 0}, j.rpy[0]);
        const double value = j.clamped(j.value);
        if (j.kind == "prismatic") f = f * moved({j.axis[0] * value, j.axis[1] * value, j.axis[2] * value});
        if (j.kind == "revolute" || j.kind == "continuous") f = f * turned(j.axis, value);
        return f;
    }

    std::vector<Joint> joints;

  private:
    double real(double from, double to) { return std::uniform_real_distribution<double>(from, to)(dice_); }
    std::mt19937 dice_;
};

/// Where each node with a DEF is in the world.
std::map<std::string, glm::dmat4> transformsOf(const Scene& scene) {
    std::map<std::string, glm::dmat4> positions;
    struct Open {
        NodeId node;
        glm::dmat4 world;
    };
    std::vector<Open> open{{scene.root(), glm::dmat4(1)}};
    while (!open.empty()) {
        const auto [id, world] = open.back();
        open.pop_back();
        const Node& node = scene.node(id);
        const glm::dmat4 inside = world * parentFromLocal(scene, node);
        if (!scene.name(id).empty()) positions[std::string(scene.name(id))] = inside;
        for (const FieldIndex field : node.type().nodeFields()) {
            if (!isTransform(node.type(), field) || !node.type().fields[field].readable()) continue;
            if (node.type().fields[field].type == FieldType::SFNode) {
                if (const NodeId child = node.get(Field<NodeId>{field})) open.push_back({child, inside});
                continue;
            }
            for (const NodeId child : node.get(Field<Array<NodeId>>{field})) open.push_back({child, inside});
        }
    }
    return positions;
}

double distance(const Frame& wanted, const glm::dmat4& found) {
    double maximum = 0;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 4; ++j) maximum = std::max(maximum, std::abs(wanted.m[i][j] - found[j][i]));
    return maximum;
}

void send(Scene& scene, const std::string& field, float value) {
    const auto target = findField(scene, field);
    ASSERT_TRUE(target) << target.error().text;
    ASSERT_TRUE(scene.sendEvent(target->node, target->field, Value(value)));
}

TEST(Urdf, LinksStandWhereKinematicsInDoubleHasThem) {
    for (unsigned seed = 1; seed <= 12; ++seed) {
        RandomRobot robot(seed, 14);
        Scene scene;
        Diagnostics problems("robot.urdf");
        ASSERT_TRUE(loadText(scene, robot.text(), problems)) << test::allText(problems);
        EXPECT_EQ(problems.errors(), 0u) << test::allText(problems);
        scene.newFrame(0);
        double largest = 0;
        for (int pose = 1; pose <= 6; ++pose) {
            robot.move();
            for (std::size_t i = 0; i < robot.joints.size(); ++i) {
                const RandomRobot::Joint& joint = robot.joints[i];
                if (!joint.hasValue() || joint.mimics >= 0) continue;
                const std::string field = joint.kind == "prismatic" ? "position" : "angle";
                send(scene, fmt::format("j{}.{}", i + 1, field), static_cast<float>(joint.value));
            }
            scene.newFrame(pose);
            const auto positions = transformsOf(scene);
            for (int link = 0; link <= static_cast<int>(robot.joints.size()); ++link)
                largest = std::max(largest, distance(robot.link(link), positions.at(fmt::format("l{}", link))));
        }
        // A float has 24 bits; joints that mimic others that turn far double what is lost, and arms are metres long.
        EXPECT_LT(largest, 5e-4) << "seed " << seed << "\n" << robot.text();
        EXPECT_EQ(test::allText(scene.diagnostics()), "") << "seed " << seed;
    }
}

constexpr std::string_view kElbow =
    "<robot name='r'><link name='a'/><link name='b'/><joint name='elbow' type='revolute'><parent link='a'/>"
    "<child link='b'/><axis xyz='0 0 1'/><limit lower='-1' upper='2'/></joint></robot>";

TEST(Urdf, AJointTurnsToAFewMillionthsAndStopsAtItsLimits) {
    Scene scene;
    Diagnostics problems;
    ASSERT_TRUE(loadText(scene, kElbow, problems)) << test::allText(problems);
    scene.newFrame(0);
    double time = 0;
    for (const double angle : {-5.0, -1.0, -.3, 0.0, .7853981, 1.5, 1.999, 2.0, 9.0}) {
        send(scene, "elbow.angle", static_cast<float>(angle));
        scene.newFrame(++time);
        const Frame wanted = turned({1, 0, 0}, -std::acos(0)) * turned({0, 0, 1}, std::min(std::max(angle, -1.0), 2.0));
        EXPECT_LT(distance(wanted, transformsOf(scene).at("b")), 1e-6) << angle;
    }
}

TEST(Urdf, AContinuousJointTurnsThousandsOfTimesAsExactlyAsAFloatTellsItsAngle) {
    std::string text(kElbow);
    text.replace(text.find("revolute"), 8, "continuous");
    Scene scene;
    Diagnostics problems;
    ASSERT_TRUE(loadText(scene, text, problems)) << test::allText(problems);
    double time = 0;
    for (const float angle :
         {0.f, 1e-3f, -3.1415f, 3.1416f, 3.2f, -6.2831f, 100.f, -201.f, 201.06f, 202.f, 5000.f, -25'900.f}) {
        send(scene, "elbow.angle", angle);
        scene.newFrame(++time);
        const Frame wanted = turned({1, 0, 0}, -std::acos(0)) * turned({0, 0, 1}, angle);
        const double step = std::abs(double(std::nextafter(angle, 1e9f)) - angle);
        EXPECT_LT(distance(wanted, transformsOf(scene).at("b")), 1e-6 + 2 * step) << angle;
    }
}

TEST(Urdf, WhereZeroIsBeyondTheLimitsTheNearestIsTheStartAndSoItIsForWhoMimics) {
    Scene scene;
    Diagnostics problems;
    ASSERT_TRUE(loadText(scene,
                         "<robot name='r'><link name='a'/><link name='b'/><link name='c'/>"
                         "<joint name='m' type='prismatic'><parent link='b'/><child link='c'/><axis xyz='1 0 0'/>"
                         "<limit lower='0' upper='9'/><mimic joint='j' multiplier='2' offset='1'/></joint>"
                         "<joint name='j' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/>"
                         "<limit lower='.5' upper='2'/></joint></robot>",
                         problems))
        << test::allText(problems);
    scene.newFrame(0);
    const auto value = [&](const char* field) {
        const auto found = findField(scene, field);
        return scene.node(found->node).get(Field<float>{found->field});
    };
    EXPECT_EQ(value("j.angle"), .5f);
    EXPECT_EQ(value("m.position"), 2.f);
    const Frame b = turned({1, 0, 0}, -std::acos(0)) * turned({0, 0, 1}, .5);
    EXPECT_LT(distance(b, transformsOf(scene).at("b")), 1e-6);
    EXPECT_LT(distance(b * moved({2, 0, 0}), transformsOf(scene).at("c")), 1e-6);
    send(scene, "j.angle", 7);  // stops at 2
    scene.newFrame(1);
    EXPECT_LT(distance(turned({1, 0, 0}, -std::acos(0)) * turned({0, 0, 1}, 2) * moved({5, 0, 0}),
                       transformsOf(scene).at("c")),
              1e-6);
}

TEST(Urdf, TheViewpointHasAllOfARobotInView) {
    Scene scene;
    Diagnostics problems;
    ASSERT_TRUE(loadText(scene,
                         "<robot name='r'><link name='a'/><link name='b'><visual><geometry><sphere radius='.5'/>"
                         "</geometry></visual></link><joint name='j' type='fixed'><parent link='a'/><child link='b'/>"
                         "<origin xyz='0 0 3' rpy='0 1.5707963267948966 0'/></joint><link name='c'><visual><geometry>"
                         "<sphere radius='.5'/></geometry></visual></link><joint name='k' type='fixed'>"
                         "<parent link='b'/><child link='c'/><origin xyz='-2 0 0'/></joint></robot>",
                         problems));
    const Node* view = nullptr;
    scene.forEachNode([&](const Node& node) { view = node.is(x3d::Viewpoint::type) ? &node : view; });
    ASSERT_TRUE(view);
    // From the floor to half a metre above the upper ball, which is at 5: turned by a quarter, -x points up.
    const Vec3f middle = view->get(x3d::Viewpoint::centerOfRotation), eye = view->get(x3d::Viewpoint::position);
    EXPECT_NEAR(middle.x, 0, 1e-5);
    EXPECT_NEAR(middle.y, 2.75, 1e-5);
    EXPECT_NEAR(middle.z, 0, 1e-5);
    const double half = std::sqrt(5.5 * 5.5 + 1 + 1) / 2, distance = glm::length(eye - middle);
    EXPECT_NEAR(distance, 1.15 * half / std::sin(.785398 / 2), 1e-4);
    // It looks at the middle.
    const Rotation rotation = view->get(x3d::Viewpoint::orientation);
    const Frame looks = turned({rotation.x, rotation.y, rotation.z}, rotation.angle);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(eye[i] - distance * looks.m[i][2], middle[i], 1e-4) << i;
}

// ---- what it looks like ------------------------------------------------------------------------------------------

std::string inLink(const std::string& content, const std::string& beside = {}) {
    return "<robot name='r'>" + beside + "<link name='a'>" + content + "</link></robot>";
}

TEST(Urdf, BodiesAreX3dsWithTheirAxesAndMaterials) {
    const Imported robot(inLink("<visual name='leg'><origin xyz='0 0 1' rpy='0 0 0'/><geometry><cylinder radius='.5' "
                                "length='2'/></geometry><material name='blue'/></visual>"
                                "<visual><geometry><box size='1 2 3'/></geometry><material name='blue'/></visual>"
                                "<visual><geometry><sphere radius='4'/></geometry><material name='glass'><color "
                                "rgba='1 1 1 0.25'/></material></visual>"
                                "<visual><geometry><sphere radius='1'/></geometry><material name='glass'/></visual>",
                                "<material name='blue'><color rgba='0 0 1 1'/></material>"),
                         "4.1");
    EXPECT_EQ(robot.problems, "");
    EXPECT_THAT(robot.commands, HasSubstr("begin Transform DEF leg in children\nset translation SFVec3f 0 0 1\n"
                                          "begin Transform in children\nset rotation SFRotation 1 0 0 1.5707964\n"));
    EXPECT_THAT(robot.commands, HasSubstr("set height SFFloat 2\nset radius SFFloat 0.5"));
    EXPECT_THAT(robot.commands, HasSubstr("begin Appearance DEF blue in appearance\nbegin Material in material\n"
                                          "set diffuseColor SFColor 0 0 1"));
    EXPECT_THAT(robot.commands, HasSubstr("use blue in appearance\nbegin Box in geometry\nset size SFVec3f 1 2 3"));
    EXPECT_THAT(robot.commands, HasSubstr("set transparency SFFloat 0.75"));
    EXPECT_THAT(robot.commands, HasSubstr("begin Sphere in geometry\nset radius SFFloat 4"));
    EXPECT_THAT(robot.commands, HasSubstr("use glass in appearance\nbegin Sphere in geometry\nset radius SFFloat 1"));
}

TEST(Urdf, MeshesAreInlinedAndThoseWithoutMaterialsHaveTheRobots) {
    const Imported robot(inLink("<visual><geometry><mesh filename='package://arm/a.STL' scale='.001 .001 .001'/>"
                                "</geometry><material name='m'><color rgba='1 0 0 1'/></material></visual>"
                                "<visual><geometry><mesh filename='b.dae'/></geometry></visual>"),
                         "4.1");
    EXPECT_EQ(robot.problems, "");
    EXPECT_THAT(robot.commands, HasSubstr("set scale SFVec3f 0.001 0.001 0.001\nbegin Shape in children\n"
                                          "begin Appearance DEF m in appearance"));
    EXPECT_THAT(robot.commands, HasSubstr("begin InlineGeometry in geometry\nset smooth SFBool FALSE\n"
                                          "set url MFString [\"package://arm/a.STL\"]"));
    EXPECT_THAT(robot.commands, HasSubstr("begin Inline in children\nset url MFString [\"b.dae\"]"));
}

TEST(Urdf, TheAxesOfAColladaFileStayAsTheyAre) {
    for (const char* up : {"X_UP", "Y_UP", "Z_UP"}) {
        const test::TempFolder folder;
        std::ofstream(folder / "lid.dae")
            << "<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' version='1.4.1'><asset><unit "
               "meter='0.01'/>"
               "<up_axis>"
            << up
            << "</up_axis></asset><library_geometries><geometry id='g'><mesh><source id='p'><float_array id='a' "
               "count='9'>0 0 0 1 0 0 0 1 0</float_array><technique_common><accessor source='#a' count='3' stride='3'>"
               "<param name='X' type='float'/><param name='Y' type='float'/><param name='Z' type='float'/></accessor>"
               "</technique_common></source><vertices id='v'><input semantic='POSITION' source='#p'/></vertices>"
               "<triangles count='1'><input semantic='VERTEX' source='#v' offset='0'/><p>0 1 2</p></triangles></mesh>"
               "</geometry></library_geometries><library_visual_scenes><visual_scene id='s'><node id='lid' name='lid'>"
               "<translate>10 20 30</translate><instance_geometry url='#g'/></node></visual_scene>"
               "</library_visual_scenes><scene><instance_visual_scene url='#s'/></scene></COLLADA>";
        std::ofstream(folder / "r.urdf") << inLink(
            "<visual><geometry><mesh filename='lid.dae' scale='1 1 2'/></geometry></visual>");
        Scene scene;
        Diagnostics problems;
        ASSERT_TRUE(loadFile(scene, folder / "r.urdf", problems));
        EXPECT_EQ(test::allText(problems), "") << up;
        // In the robot's frame it is at .1 .2 .6, in the scene's, where y points up, at .1 .6 -.2.
        const glm::dmat4 lid = transformsOf(scene).at("lid");
        EXPECT_NEAR(lid[3][0], .1, 1e-6) << up;
        EXPECT_NEAR(lid[3][1], .6, 1e-6) << up;
        EXPECT_NEAR(lid[3][2], -.2, 1e-6) << up;
    }
}

TEST(Urdf, CollisionsAreOneSwitchAway) {
    const test::TempFolder folder;
    std::ofstream(folder / "tile.stl")
        << "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\n"
           "endsolid\n";
    std::ofstream(folder / "r.urdf") << inLink(
        "<collision><geometry><box size='1 1 1'/></geometry></collision>"
        "<collision><geometry><mesh filename='tile.stl'/></geometry></collision>");
    Scene scene;
    Diagnostics problems;
    ASSERT_TRUE(loadFile(scene, folder / "r.urdf", problems)) << test::allText(problems);
    EXPECT_EQ(test::allText(problems), "");
    const auto isTrue = [&](const char* field) {
        const auto found = findField(scene, field);
        return scene.node(found->node).get(Field<bool>{found->field});
    };
    EXPECT_FALSE(isTrue("a_collision.visible"));
    EXPECT_FALSE(isTrue("mesh.load"));
    const auto target = findField(scene, "collisions.visible");
    ASSERT_TRUE(target);
    ASSERT_TRUE(scene.sendEvent(target->node, target->field, Value(true)));
    scene.newFrame(1);
    EXPECT_TRUE(isTrue("a_collision.visible"));
    EXPECT_TRUE(isTrue("mesh.load"));
}

TEST(Urdf, FilesOfPackagesAreFoundAndMissingOnesAreNamedWithTheirPlace) {
    const test::TempFolder folder;
    std::filesystem::create_directories(folder / "robot");
    std::filesystem::create_directories(folder / "shared/meshes");
    std::ofstream(folder / "shared/meshes/tile.stl")
        << "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\n"
           "endsolid\n";
    std::ofstream(folder / "robot/r.urdf")
        << "<robot name='r'><link name='a'>\n"
           "<visual><geometry><mesh filename='package://shared/meshes/tile.stl'/></geometry></visual>\n"
           "<visual><geometry><mesh filename='package://shared/meshes/none.stl'/></geometry></visual>\n"
           "<visual><geometry><mesh filename='package://../robot/r.urdf'/></geometry></visual>\n"
           "<visual><geometry><mesh filename='package://shared/../robot/r.stl'/></geometry></visual>\n"
           "</link></robot>\n";
    ResourcePolicy policy;
    policy.packages = {{"shared", folder / "shared"}};
    LoadOptions options;
    options.resources = Resources::ofFile(folder / "robot/r.urdf", policy);
    Scene scene;
    Diagnostics problems("r.urdf");
    ASSERT_TRUE(loadFile(scene, folder / "robot/r.urdf", problems, options));
    const std::string all = test::allText(problems);
    EXPECT_EQ(problems.errors(), 3u) << all;
    EXPECT_THAT(all, HasSubstr("r.urdf:3:19: error: InlineGeometry: 'package://shared/meshes/none.stl' is not there"));
    EXPECT_THAT(all,
                HasSubstr("r.urdf:4:19: error: Inline: 'package://../robot/r.urdf': nothing says where the package "
                          ".. is; --package ..=FOLDER does"));
    EXPECT_THAT(all, HasSubstr("r.urdf:5:19: error: InlineGeometry: 'package://shared/../robot/r.stl'"));
}

// ---- what is wrong ------------------------------------------------------------------------------------------------

struct Odd {
    const char* what;
    std::string text, says;
    bool usable = true;
};

std::string joint(const std::string& attributes, const std::string& content = {}) {
    return "<robot name='r'><link name='a'/><link name='b'/><joint " + attributes + ">" + content +
           "<parent link='a'/><child link='b'/></joint></robot>";
}

std::vector<Odd> oddRobots() {
    const std::string ends = "<parent link='a'/><child link='b'/>";
    return {
        {"no name", "<robot><link name='a'/></robot>", "1:1: error: the robot has no name"},
        {"no links", "<robot name='r'/>", "the robot has no links", false},
        {"not closed", "<robot name='r'>\n<link name='a'>", "2:16: error: not well-formed XML", false},
        {"cut off", "<robot name='r'><link na", "not well-formed XML", false},
        {"two roots", "<robot name='r'><link name='a'/><link name='b'/></robot>", "no joint ends in it, nor in link a"},
        {"two of one name", "<robot name='r'><link name='a'/><link name='a'/></robot>",
         "link a: there is one of that name already"},
        {"no name of a link", "<robot name='r'><link name='a'/><link/></robot>", "link: it has no name"},
        {"no such link",
         "<robot name='r'><link name='a'/><joint name='j' type='fixed'><parent link='a'/><child link='x'/></joint>"
         "</robot>",
         "joint j: there is no link x"},
        {"no parent", "<robot name='r'><link name='a'/><joint name='j' type='fixed'><child link='a'/></joint></robot>",
         "joint j: it names no parent link"},
        {"two parents",
         joint("name='j' type='fixed'").substr(0, joint("name='j' type='fixed'").size() - 8) +
             "<joint name='k' type='fixed'>" + ends + "</joint></robot>",
         "joint k: another joint ends in link b"},
        {"a circle",
         "<robot name='r'><link name='a'/><link name='b'/><joint name='j' type='fixed'>" + ends +
             "</joint><joint name='k' type='fixed'><parent link='b'/><child link='a'/></joint></robot>",
         "it closes a circle of links"},
        {"a joint to itself",
         "<robot name='r'><link name='a'/><joint name='j' type='fixed'><parent link='a'/><child link='a'/></joint>"
         "</robot>",
         "it closes a circle of links"},
        {"no type", joint("name='j'"), "joint j: it has no type; it is fixed here"},
        {"a type of its own", joint("name='j' type='ball'"), "no kind of joint is called ball"},
        {"no limit", joint("name='j' type='revolute'"), "joint j: it has no limit, so it does not move"},
        {"limits exchanged", joint("name='j' type='revolute'", "<limit lower='1' upper='-1'/>"),
         "its lower limit is above the upper one"},
        {"no direction", joint("name='j' type='continuous'", "<axis xyz='0 0 0'/>"), "its axis has no direction"},
        {"words for numbers", joint("name='j' type='fixed'", "<origin xyz='one two three'/>"),
         "origin: xyz=\"one two three\": expected 3 numbers"},
        {"two numbers", joint("name='j' type='fixed'", "<origin xyz='1 2'/>"), "expected 3 numbers"},
        {"four numbers", joint("name='j' type='fixed'", "<origin xyz='1 2 3 4'/>"), "expected 3 numbers"},
        {"nan", joint("name='j' type='fixed'", "<origin xyz='0 nan 0'/>"), "expected 3 numbers"},
        {"infinite", joint("name='j' type='prismatic'", "<limit lower='-inf' upper='1e999'/>"), "expected a number"},
        {"mimics nobody", joint("name='j' type='continuous'", "<mimic joint='x'/>"),
         "it mimics x, which is no joint that moves"},
        {"mimics itself", joint("name='j' type='continuous'", "<mimic joint='j'/>"), "it mimics in a circle"},
        {"a macro", "<robot name='r' xmlns:xacro='x'><xacro:include filename='a'/><link name='a'/></robot>",
         "xacro:include: a macro that is not expanded; it is left out"},
        {"macros alone", "<robot name='r' xmlns:xacro='x'><xacro:macro name='m'><link name='a'/></xacro:macro></robot>",
         "xacro:macro: a macro that is not expanded", false},
        {"an expression", "<robot name='${name}'><link name='a'/></robot>", "an expression of xacro", false},
        {"no geometry", inLink("<visual/>"), "visual: it has no geometry"},
        {"a geometry of its own", inLink("<visual><geometry><cone/></geometry></visual>"),
         "cone: no kind of geometry that is known"},
        {"a box of nothing", inLink("<visual><geometry><box size='-1 1 1'/></geometry></visual>"),
         "sizes are greater than 0"},
        {"a box without size", inLink("<visual><geometry><box/></geometry></visual>"), "box: it has no size"},
        {"a mesh without a file", inLink("<visual><geometry><mesh/></geometry></visual>"), "mesh: it has no filename"},
        {"a mesh of no size", inLink("<visual><geometry><mesh filename='a.stl' scale='1 0 1'/></geometry></visual>"),
         "its scale has a 0"},
        {"a material that nothing defines",
         inLink("<visual><geometry><sphere radius='1'/></geometry><material name='x'/></visual>"),
         "material x: nothing defines it"},
    };
}

TEST(Urdf, OddAndHostileRobotsAreToldAndTheRestIsThere) {
    for (const Odd& odd : oddRobots()) {
        const Imported robot(odd.text, "4.1");
        EXPECT_EQ(robot.good, odd.usable) << odd.what;
        EXPECT_THAT(robot.problems, HasSubstr(odd.says)) << odd.what;
        EXPECT_THAT(robot.problems, HasSubstr("error")) << odd.what;
        EXPECT_EQ(robot.commands.contains("begin Transform DEF a"), odd.usable) << odd.what;
    }
}

TEST(Urdf, ColorsBeyondTheirRangeAreTold) {
    const Imported robot(inLink("<visual><geometry><sphere radius='1'/></geometry><material name='m'>"
                                "<color rgba='255 0 0 1'/></material></visual>"),
                         "4.1");
    EXPECT_THAT(robot.problems, HasSubstr("warning: color: its numbers are from 0 to 1"));
    EXPECT_THAT(robot.commands, HasSubstr("set diffuseColor SFColor 1 0 0"));
}

TEST(Urdf, WhatFilesHaveAndMeansNothingIsNoError) {
    const Imported robot(
        "<robot name='r'><link name='a'><visual><geometry><box size='0 0 0'/></geometry></visual></link>"
        "<link name='b'/><joint name='j' type='fixed'><parent link='a'/><child link='b'/>"
        "<axis xyz='0 0 0'/></joint></robot>",
        "4.1");
    EXPECT_EQ(robot.problems, "test:1:50: warning: box: it has no size; it is left out [parse]\n");
}

TEST(Urdf, PrototypesHaveAsManyValuesAsKeysByThemselves) {
    std::string text(kElbow);
    text.replace(text.find("revolute"), 8, "continuous");
    const Imported robot(text, "4.1");
    EXPECT_THAT(robot.commands, HasSubstr("MFRotation keyValue = [0 0 1 -3.1415927, 0 0 1 -1.5707964, 0 0 1 0, 0 0 1 "
                                          "1.5707964, 0 0 1 3.1415927]"));
}

TEST(Urdf, WhatIsNotMadeIsNamedOnce) {
    const Imported robot(
        "<robot name='r'><gazebo/><link name='a'><inertial/></link><link name='b'><inertial/></link>"
        "<joint name='j' type='fixed'><parent link='a'/><child link='b'/><dynamics/></joint></robot>",
        "4.1");
    EXPECT_EQ(robot.problems,
              "test: warning: left out, as nothing is made of it here: dynamics, gazebo, inertial (2) [parse]\n");
}

TEST(Urdf, EntitiesThatGrowWithoutEndAndNestingWithoutEndAreBounded) {
    std::string bomb = "<!DOCTYPE robot [<!ENTITY a 'aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa'>";
    for (char c = 'b'; c <= 'k'; ++c) {
        bomb += fmt::format("<!ENTITY {} '", c);
        for (int i = 0; i < 10; ++i) bomb += fmt::format("&{};", static_cast<char>(c - 1));
        bomb += "'>";
    }
    const Imported entities(bomb + "]><robot name='&k;'><link name='a'/></robot>", "4.1");
    EXPECT_FALSE(entities.good);
    EXPECT_THAT(entities.problems, HasSubstr("not well-formed XML"));
    std::string chain = "<!DOCTYPE robot [<!ENTITY e0 'x'>";
    for (int i = 1; i <= 60'000; ++i) chain += fmt::format("<!ENTITY e{} '&e{};'>", i, i - 1);
    const Imported chained(chain + "]><robot name='&e60000;'><link name='a'/></robot>", "4.1");
    EXPECT_FALSE(chained.good);
    EXPECT_THAT(chained.problems, HasSubstr("entities stand more than 32 deep within each other"));
    std::string nested = "<robot name='r'><link name='a'>";
    for (int i = 0; i < 200'000; ++i) nested += "<x>";
    for (int i = 0; i < 200'000; ++i) nested += "</x>";
    const Imported deep(nested + "</link></robot>", "4.1");
    EXPECT_TRUE(deep.good);
    std::string many = "<robot name='r'><link name='a'/>";
    for (int i = 0; i < 1'000'001; ++i) many += "<x/>";
    const Imported elements(many + "</robot>", "4.1");
    EXPECT_FALSE(elements.good);
    EXPECT_THAT(elements.problems, HasSubstr("more than a million elements"));
}

TEST(Urdf, AChainOfAThousandLinksIsNoDeeperThanTheStack) {
    std::string text = "<robot name='r'><link name='l0'/>";
    for (int i = 1; i <= 1000; ++i)
        text += fmt::format(
            "<link name='l{0}'/><joint name='j{0}' type='revolute'><parent link='l{1}'/><child link='l{0}'/>"
            "<origin xyz='0 0 .01'/><limit lower='-1' upper='1'/></joint>",
            i, i - 1);
    Scene scene;
    Diagnostics problems;
    ASSERT_TRUE(loadText(scene, text + "</robot>", problems));
    EXPECT_EQ(test::allText(problems), "");
    scene.newFrame(0);
    EXPECT_NEAR(transformsOf(scene).at("l1000")[3][1], 10, 1e-4);
}

TEST(Urdf, AScenesRoutesReachTheJointsOfARobotThatItInlines) {
    const test::TempFolder folder;
    std::ofstream(folder / "r.urdf") << kElbow;
    Scene scene;
    Diagnostics problems;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\nDEF R Inline { url \"r.urdf\" }\nIMPORT R.elbow AS E\n"
                         "DEF S ScalarInterpolator { key [ 0 1 ] keyValue [ 0.5 1 ] }\n"
                         "ROUTE S.value_changed TO E.angle\n",
                         problems, folder.path()));
    EXPECT_EQ(test::allText(problems), "");
    scene.newFrame(0);
    send(scene, "S.set_fraction", 0);
    scene.newFrame(1);
    const Frame wanted = turned({1, 0, 0}, -std::acos(0)) * turned({0, 0, 1}, .5);
    EXPECT_LT(distance(wanted, transformsOf(scene).at("b")), 1e-6);
}

TEST(Urdf, WhatIsWrittenAsX3dIsTheSameRobot) {
    for (const Encoding encoding : {Encoding::xml, Encoding::classicVrml, Encoding::json}) {
        std::string text;
        Diagnostics problems;
        {
            const auto writer = makeWriter(encoding, [&](std::string_view piece) { text += piece; }, problems);
            ASSERT_TRUE(readDocument(kElbow, *writer, problems));
        }
        Scene direct, again;
        ASSERT_TRUE(loadText(direct, kElbow, problems));
        ASSERT_TRUE(loadText(again, text, problems)) << text;
        EXPECT_EQ(test::allText(problems), "") << text;
        for (Scene* scene : {&direct, &again}) {
            scene->newFrame(0);
            send(*scene, "elbow.angle", 1.25f);
            scene->newFrame(1);
        }
        EXPECT_EQ(transformsOf(direct).at("b"), transformsOf(again).at("b"));
    }
}

/// The scene as a document.
std::string documentOf(const Scene& scene, Encoding encoding) {
    std::string text;
    Diagnostics problems;
    const auto writer = makeWriter(encoding, [&](std::string_view piece) { text += piece; }, problems);
    SceneExporter(scene, problems).write(*writer, encoding);
    EXPECT_EQ(test::allText(problems), "");
    return text;
}

TEST(Urdf, ARobotThatHasMovedIsSavedAsItStands) {
    for (const unsigned seed : {1u, 2u, 3u, 4u, 5u}) {
        RandomRobot robot(seed, 14);
        Scene scene;
        Diagnostics problems("robot.urdf");
        ASSERT_TRUE(loadText(scene, robot.text(), problems)) << test::allText(problems);
        scene.newFrame(0);
        robot.move();
        for (std::size_t i = 0; i < robot.joints.size(); ++i) {
            const RandomRobot::Joint& joint = robot.joints[i];
            if (!joint.hasValue() || joint.mimics >= 0) continue;
            send(scene, fmt::format("j{}.{}", i + 1, joint.kind == "prismatic" ? "position" : "angle"),
                 static_cast<float>(joint.value));
        }
        scene.newFrame(1);
        const auto there = transformsOf(scene);
        for (const Encoding encoding : {Encoding::xml, Encoding::classicVrml, Encoding::json}) {
            const std::string text = documentOf(scene, encoding);
            EXPECT_THAT(text, testing::Not(HasSubstr("Script"))) << "any browser plays it";
            Scene again;
            ASSERT_TRUE(loadText(again, text, problems));
            EXPECT_EQ(problems.errors(), 0U) << test::allText(problems);
            for (const auto& [name, transform] : transformsOf(again))
                for (int c = 0; c < 4; ++c)
                    EXPECT_LT(glm::length(transform[c] - there.at(name)[c]), 1e-5) << name << ", seed " << seed;
            // It moves on from there.
            again.newFrame(2);
            scene.newFrame(2);
            EXPECT_EQ(documentOf(again, encoding), text) << "seed " << seed;
        }
    }
}

}  // namespace
}  // namespace rtsg
