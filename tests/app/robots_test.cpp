// Robots' files in the program: a feed moves joints, and --package says where meshes are.
#include <filesystem>
#include <fstream>

#include "program.h"

namespace rtsg::test {

class Robots : public CommandLine {
  protected:
    const std::string arm = RTSG_SOURCE_DIR "/examples/robot/arm.urdf",
                      package = "arm=" RTSG_SOURCE_DIR "/examples/robot";
};

TEST_F(Robots, JointsMoveByAFeed) {
    const Outcome fed =
        rtsg(atZero({"run", arm, "--package", package, "--for", "1s", "--feed", "-", "--watch", "elbow.angle",
                     "--watch", "grip_too.position", "--watch", "grip_too/Moving.translation"}),
             "{\"t\":0.5,\"node\":\"elbow\",\"field\":\"angle\",\"value\":1.25}\n"
             "{\"t\":0.5,\"node\":\"grip\",\"field\":\"position\",\"value\":0.25}\n");
    EXPECT_EQ(fed.status, 0) << fed.err;
    EXPECT_NE(fed.out.find(R"("node":"elbow","field":"angle","value":1.25)"), std::string::npos) << fed.out;
    // The gripper opens .05 at most, and its other finger the other way.
    EXPECT_NE(fed.out.find(R"("node":"grip_too","field":"position","value":-0.05)"), std::string::npos) << fed.out;
    EXPECT_NE(fed.out.find(R"("field":"translation","value":[0,-0.05,0])"), std::string::npos) << fed.out;
}

TEST_F(Robots, MeshesThatAreMissingAreNamedWithTheirLine) {
    const Outcome missing = rtsg({"run", arm, "--for", "0.1s"});
    EXPECT_EQ(missing.status, 1);
    EXPECT_NE(missing.err.find("arm.urdf:48:17:"), std::string::npos) << missing.err;
    EXPECT_NE(missing.err.find("nothing says where the package arm is; --package arm=FOLDER does"), std::string::npos)
        << missing.err;
}

TEST_F(Robots, APackageIsANameAndAFolder) {
    for (const char* wrong : {"arm", "=/tmp", "arm=", "arm=/no/such/folder"}) {
        const Outcome run = rtsg({"run", arm, "--package", wrong});
        EXPECT_EQ(run.status, 2) << wrong;
        EXPECT_NE(run.err.find("--package"), std::string::npos) << run.err;
    }
}

TEST_F(Robots, WhatIsConvertedIsX3dThatNeedsNothingOfTheRobotsFile) {
    const Outcome converted = rtsg({"convert", arm, folder / "arm.x3d", "--package", package});
    EXPECT_EQ(converted.status, 0) << converted.err;
    const Outcome again = rtsg(atZero(
        {"run", folder / "arm.x3d", "--for", "1s", "--set", "elbow.angle=9@0.5", "--watch", "elbow/Moving.rotation"}));
    EXPECT_EQ(again.status, 0) << again.err;
    EXPECT_NE(again.out.find(R"("value":[0,1,0,2.4])"), std::string::npos) << again.out;
}

TEST_F(Robots, MeshesStayInTheirFilesIfAskedAndAMissingOneIsStatusOne) {
    const auto text = [&](const char* name) {
        std::ifstream in(folder / name);
        return std::string(std::istreambuf_iterator<char>(in), {});
    };
    EXPECT_EQ(rtsg({"convert", arm, folder / "kept.x3d", "--keep-meshes"}).status, 0);
    EXPECT_NE(text("kept.x3d").find("package://arm/meshes/beam.stl"), std::string::npos);
    const Outcome missing = rtsg({"convert", arm, folder / "missing.x3d"});
    EXPECT_EQ(missing.status, 1);
    EXPECT_NE(missing.err.find("--package arm=FOLDER"), std::string::npos) << missing.err;
    EXPECT_EQ(rtsg({"convert", folder / "kept.x3d", folder / "a.x3d", "--keep-meshes"}).status, 2);
}

TEST_F(Robots, OneThatHasMovedIsSavedAsItStands) {
    for (const char* name : {"moved.x3d", "moved.rtsgb"}) {
        const Outcome run = rtsg({"run", arm, "--package", package, "--for", "0.2s", "--set", "elbow.angle=1.25@0.1",
                                  "--save", folder / name});
        ASSERT_EQ(run.status, 0) << run.err;
        EXPECT_EQ(rtsg({"convert", folder / name, folder / "again.x3dv", "--force"}).status, 0);
        std::ifstream in(folder / "again.x3dv");
        const std::string text(std::istreambuf_iterator<char>(in), {});
        const std::size_t elbow = text.find("DEF elbow RevoluteJoint");
        ASSERT_NE(elbow, std::string::npos) << text;
        EXPECT_NE(text.find("angle 1.25", elbow), std::string::npos) << text;
        EXPECT_NE(text.find("pose 0 1 0 1.2", elbow), std::string::npos) << text;
    }
}

}  // namespace rtsg::test
