// SDF files as robots: frames, joints and shapes stand where the specification has them.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <rtsg/core/field_path.h>
#include <rtsg/core/placement.h>
#include <rtsg/documents/loader.h>

#include "core/scene_check.h"
#include "documents/import/imported.h"

namespace rtsg {
namespace {

using test::Imported;
using testing::HasSubstr;

/// Where the node of a DEF is in the scene, whose y axis points up.
Vec3d positionOf(const Scene& scene, std::string_view name) {
    glm::dmat4 world(1);
    for (NodeId id = scene.findName(name); id && id != scene.root();) {
        const Node& node = scene.node(id);
        world = parentFromLocal(scene, node) * world;
        // The children of a prototype's instance are below its body.
        NodeId next{};
        for (const ParentRef& parent : scene.parents(id))
            if (scene.node(parent.node).scope() || !next) next = parent.node;
        id = next ? next : node.scope();
    }
    return Vec3d(world[3]);
}

std::string sdf(const std::string& model) {
    return "<?xml version='1.0'?><sdf version='1.9'><model name='m'>" + model + "</model></sdf>";
}
std::string link(const char* name, const char* pose) {
    return std::string("<link name='") + name + "'><pose>" + pose + "</pose><visual name='" + name +
           "_look'><geometry><sphere><radius>.1</radius></sphere></geometry></visual></link>";
}
constexpr const char* kHinge =
    "<joint name='hinge' type='revolute'><parent>a</parent><child>b</child><pose>0 0 -1 0 0 0</pose>"
    "<axis><xyz>0 1 0</xyz><limit><lower>-1</lower><upper>2</upper></limit></axis></joint>";

void expectAt(const Scene& scene, const char* name, const Vec3d& wanted) {
    // z of the file is y of the scene.
    EXPECT_LT(glm::length(positionOf(scene, name) - Vec3d(wanted.x, wanted.z, -wanted.y)), 1e-5) << name;
}

TEST(Sdf, LinksStandInTheModelAndTurnAboutTheirJoints) {
    Scene scene;
    Diagnostics problems("m.sdf");
    ASSERT_TRUE(
        loadText(scene, sdf(link("a", "1 2 3 0 0 1.5707963267948966") + link("b", "1 2 5 0 0 0") + kHinge), problems));
    EXPECT_EQ(test::allText(problems), "");
    scene.newFrame(0);
    expectAt(scene, "a_look", {1, 2, 3});
    expectAt(scene, "b_look", {1, 2, 5});
    const auto hinge = findField(scene, "hinge.angle");
    ASSERT_TRUE(hinge);
    ASSERT_TRUE(scene.sendEvent(hinge->node, hinge->field, Value(static_cast<float>(std::acos(0.0)))));
    scene.newFrame(1);
    expectAt(scene, "b_look", {2, 2, 4});  // a metre from the joint, which is a metre below it
    ASSERT_TRUE(scene.sendEvent(hinge->node, hinge->field, Value(9.0f)));
    scene.newFrame(2);
    expectAt(scene, "b_look", {1 + std::sin(2.0), 2, 4 + std::cos(2.0)});
}

TEST(Sdf, PosesAreInTheFramesThatTheyName) {
    Scene scene;
    Diagnostics problems("m.sdf");
    ASSERT_TRUE(loadText(
        scene,
        sdf("<pose>10 0 0 0 0 0</pose><frame name='f' attached_to='a'><pose degrees='true'>0 0 1 0 0 "
            "90</pose></frame>" +
            link("a", "1 0 0 0 0 0") +
            "<link name='b'><pose relative_to='f'>2 0 0 0 0 0</pose><visual name='b_look'><pose "
            "relative_to='__model__'>7 0 0 0 0 0</pose><geometry><box><size>1 1 1</size></box></geometry></visual>"
            "<collision "
            "name='c'><geometry><cylinder><radius>1</radius><length>2</length></cylinder></geometry></collision>"
            "</link><link name='q'><pose rotation_format='quat_xyzw'>0 3 0  0 0 0 1</pose></link>"),
        problems));
    EXPECT_EQ(test::allText(problems), "");
    expectAt(scene, "b", {11, 2, 1});
    expectAt(scene, "b_look", {17, 0, 0});
    expectAt(scene, "q", {10, 3, 0});
}

TEST(Sdf, WorldsHaveSeveralModelsAndWhatIsLeftOutIsNamedOnce) {
    const Imported world(
        "<sdf version='1.6'><world name='w'><light name='sun'/><light name='s2'/><model name='one'>" +
            link("a", "0 0 0 0 0 0") +
            "</model><model name='two'><link name='a'><inertial/><visual name='v'><geometry><plane><normal>0 0 "
            "1</normal>"
            "<size>4 2</size></plane></geometry><material><diffuse>1 .5 0 .25</diffuse></material></visual></link>"
            "<joint name='j' "
            "type='screw'><parent>world</parent><child>a</child></joint><plugin/></model></world></sdf>",
        "4.1");
    EXPECT_TRUE(world.good);
    EXPECT_THAT(world.commands, HasSubstr("meta translated=from SDF"));
    EXPECT_THAT(world.commands, HasSubstr("begin Transform DEF one_a in children"));
    EXPECT_THAT(world.commands, HasSubstr("begin Transform DEF two_a in children"));
    EXPECT_THAT(world.commands, HasSubstr("set size SFVec3f 4 2 0.001"));
    EXPECT_THAT(world.commands, HasSubstr("set diffuseColor SFColor 1 0.5 0"));
    EXPECT_THAT(world.problems, HasSubstr("no joint of the kind screw is known here; it is fixed"));
    EXPECT_THAT(world.problems, HasSubstr("left out, as nothing is made of it here: inertial, light (2), plugin"));
}

TEST(Sdf, FaultsAreNamedWithTheirPlaces) {
    const auto problems = [](const std::string& model) { return Imported(sdf(model), "4.1").problems; };
    EXPECT_THAT(problems("<link name='a'><pose>1 2 x</pose></link>"), HasSubstr("expected 6 numbers"));
    EXPECT_THAT(problems("<link name='a'><pose relative_to='z'/></link>"), HasSubstr("there is no frame z"));
    EXPECT_THAT(
        problems("<frame name='f'><pose relative_to='g'/></frame><frame name='g'><pose relative_to='f'/></frame>"
                 "<link name='a'><pose relative_to='f'/></link>"),
        HasSubstr("is in itself"));
    EXPECT_THAT(problems("<link name='a'/><joint name='j' type='fixed'><parent>a</parent><child>b</child></joint>"),
                HasSubstr("joint j: there is no link b; it is left out"));
    EXPECT_THAT(
        problems(
            "<link name='a'/><link name='b'/><joint name='j' type='fixed'><parent>a</parent><child>b</child></joint>"
            "<joint name='k' type='fixed'><parent>b</parent><child>a</child></joint>"),
        HasSubstr("form a circle"));
    EXPECT_FALSE(Imported("<sdf version='1.9'><light/></sdf>", "4.1").good);
    for (const char* text : {"<sdf>", "<sdf><model/></sdf>", "<sdf><model><link/><joint/></model></sdf>",
                             "<sdf><world><model name='a'><model name='b'><link/></model></model></world></sdf>"})
        (void)Imported(text, "4.1");
}

}  // namespace
}  // namespace rtsg
