// The table compiler: errors with positions, tags, and types made from a user's table.
#include <rtsg/core/behaviour.h>

#include <gtest/gtest.h>
#include <own_nodes.h>
#include <sys/wait.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>

#include "test_paths.h"

using namespace rtsg;

namespace own {
const Behaviour& turntableBehaviour();  // in the generated skeleton
}

namespace {

struct CompilerOutcome {
    int status = -1;
    std::string output;
};

CompilerOutcome run(const std::string& arguments) {
    CompilerOutcome result;
    FILE* pipe = popen((RTSG_SPEC_COMPILER " " + arguments + " 2>&1").c_str(), "r");
    if (!pipe) return result;
    char buffer[4096];
    while (const std::size_t n = std::fread(buffer, 1, sizeof(buffer), pipe)) result.output.append(buffer, n);
    const int status = pclose(pipe);
    result.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return result;
}

class SpecCompiler : public testing::Test {
  protected:
    void SetUp() override {
        const auto* test = testing::UnitTest::GetInstance()->current_test_info();
        folder_ = std::filesystem::path(testing::TempDir()) / (std::string("spec_compiler_") + test->name());
        std::filesystem::create_directories(folder_);
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }

    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    void write(const std::string& name, const std::string& text) const { std::ofstream(path(name)) << text; }
    CompilerOutcome compile(const std::string& table) const {
        write("t.x3dspec", table);
        return run("--header " + path("t.h") + " --source " + path("t.cpp") + ' ' + path("t.x3dspec"));
    }
    /// The table fails with exactly one error, at this line, that says this.
    void expectError(const std::string& table, int line, const std::string& text) const {
        std::filesystem::remove(path("t.h"));
        const CompilerOutcome result = compile(table);
        EXPECT_EQ(result.status, 1) << table;
        EXPECT_TRUE(result.output.starts_with(path("t.x3dspec") + ':' + std::to_string(line) + ": error: "))
            << result.output;
        EXPECT_NE(result.output.find(text), std::string::npos) << result.output << "expected: " << text;
        EXPECT_EQ(std::count(result.output.begin(), result.output.end(), '\n'), 1) << result.output;
        EXPECT_FALSE(std::filesystem::exists(path("t.h"))) << "nothing may be written after an error";
    }

    std::filesystem::path folder_;
};

const std::string kHead = "component C\nabstract A\n    SFInt32 [in,out] a 1 @none\nnode N : A level 1 container c\n";

}  // namespace

TEST_F(SpecCompiler, AcceptsWhatTheErrorsBelowAreSpoiledFrom) {
    const CompilerOutcome result = compile(kHead + "    SFFloat [in,out] x 0.5 [0,1] @none\n");
    EXPECT_EQ(result.status, 0) << result.output;
    EXPECT_EQ(result.output, "");
    EXPECT_TRUE(std::filesystem::exists(path("t.h")));
}

TEST_F(SpecCompiler, EveryErrorHasFileAndLine) {
    expectError(kHead + "    SFFloat [in,out] x 0.5\n", 5, "field 'x' must have an aspect, one of @none @structure");
    expectError(kHead + "    SFFloat [in,out] x 0.5 @colour\n", 5, "'@colour' is no tag of a field");
    expectError(kHead + "    SFFloat [inout] x 0.5 @none\n", 5, "'[inout]' is no access");
    expectError(kHead + "    SFVec5f [in,out] x 0 @none\n", 5, "not 'SFVec5f'");
    expectError(kHead + "    SFFloat [in,out] 2x 0 @none\n", 5, "'2x' cannot name a field");
    expectError(kHead + "    SFVec3f [in,out] x 0 0 @none\n", 5, "has 2 values, SFVec3f takes 3");
    expectError(kHead + "    MFVec3f [in,out] x [0 0 0 1] @none\n", 5, "has 4 values, MFVec3f takes a multiple of 3");
    expectError(kHead + "    MFVec3f [in,out] x @none\n", 5, "needs a default in brackets");
    expectError(kHead + "    SFInt32 [in,out] x 0.5 @none\n", 5, "'0.5' is no value of SFInt32");
    expectError(kHead + "    SFInt32 [in,out] x 3000000000 @none\n", 5, "is no value of SFInt32");
    expectError(kHead + "    SFFloat [in,out] x zero @none\n", 5, "'zero' is no value of SFFloat");
    expectError(kHead + "    SFBool [in,out] x true @none\n", 5, "expected TRUE or FALSE");
    expectError(kHead + "    SFString [in,out] x plain @none\n", 5, "expected a string");
    expectError(kHead + "    SFNode [in,out] x 0 @none\n", 5, "NULL");
    expectError(kHead + "    SFFloat [in,out] x 2 [0,1] @none\n", 5, "outside of its range");
    expectError(kHead + "    SFFloat [in,out] x 0 (0,1] @none\n", 5, "outside of its range");
    expectError(kHead + "    SFFloat [in,out] x 0 [1,0] @none\n", 5, "is no range");
    expectError(kHead + "    SFFloat [in,out] x 0 [A] @none\n", 5, "is no range");
    expectError(kHead + "    SFString [in,out] x \"C\" [\"A\"|\"B\"] @none\n", 5, "not among the allowed strings");
    expectError(kHead + "    SFString [in,out] x \"C [\"A\"] @none\n", 5, "not closed");
    expectError(kHead + "    SFNode [in,out] x NULL [Nobody] @structure\n", 5, "accepts unknown type 'Nobody'");
    expectError(kHead + "    SFFloat [in,out] a 0 @none\n", 5, "inherited with another type or access");
    expectError(kHead + "    SFInt32 [in,out] x 0 @none\n    SFInt32 [in,out] x 0 @none\n", 6, "listed twice");
    expectError(kHead + "    retag nothing @none\n", 5, "'N' has no field 'nothing'");
    expectError(kHead + "node N : A level 1 container c\n", 5, "already defined");
    expectError(kHead + "node M : B level 1 container c\n", 5, "unknown type 'B'");
    expectError(kHead + "node M : A container c\n", 5, "has no level");
    expectError(kHead + "node M : A level one container c\n", 5, "'one' is no level");
    expectError(kHead + "node M : A level 1\n", 5, "has no container field");
    expectError(kHead + "nod M : A level 1 container c\n", 5, "not 'nod'");
    expectError(kHead + "extend Nobody\n", 5, "cannot extend unknown type");
    expectError("node N level 1 container c\n", 1, "no `component` line");
    expectError("component C\n    SFFloat [in,out] x 0 @none\n", 2, "outside of a type");
    expectError("component C\nabstract A : B\nabstract B : A\n", 2, "inherits from itself");
    expectError(kHead + "abstract B\n    SFInt32 [in,out] a 2 @none\nnode M : A, B level 1 container c\n", 7,
                "inherits two different fields 'a'");
    // A line that goes on in the next counts as one, and the lines after it keep their numbers.
    expectError(kHead + "    SFString [in,out] x \"A\" [\"A\"|\n        \"B\"] @none\n    SFFloat [in,out] y 0\n", 7,
                "'y'");
}

TEST_F(SpecCompiler, TagsAreKnownAndNoneIsMissing) {
    const std::string node = "node M : A level 1 container c ", bounded = "abstract X3DBoundedObject\n";
    EXPECT_EQ(compile(kHead + node + "@acts(onInput) @writesInputs @role(light)\n").output, "");
    expectError(kHead + node + "@dances\n", 5, "'@dances' is no tag of a type");
    expectError(kHead + node + "@writesInputs(a)\n", 5, "'@writesInputs' is no tag of a type");
    expectError(kHead + node + "@acts\n", 5, "expected @acts(never)");
    expectError(kHead + node + "@acts(sometimes)\n", 5, "expected @acts(never)");
    expectError(kHead + node + "@role\n", 5, "names no role");
    expectError(kHead + node + "@role(king)\n", 5, "'king' is no role");
    expectError(kHead + node + "@role(group)\n", 5, "role 'group' needs fields");
    expectError(kHead + node + "@role(light a)\n", 5, "role 'light' takes no fields");
    expectError(kHead + node + "@role(group children)\n", 5, "'M' has no field 'children' of nodes");
    expectError(kHead + node + "@role(group a)\n", 5, "'M' has no field 'a' of nodes");
    // A type that can act must say when.
    for (const char* field : {"SFBool [out] x", "SFBool hidden x FALSE", "SFBool [in] x", "SFBool [in] set_b"})
        expectError(kHead + node + "\n    " + field + " @none\n", 5, "needs @acts(WHEN)");
    EXPECT_EQ(compile(kHead + node + "\n    SFInt32 [in] set_a @none\n").output, "");
    EXPECT_EQ(compile(kHead + node + "@acts(never)\n    SFBool [out] x @none\n").output, "");
    // A type with bounds must say what it is.
    expectError("component C\n" + bounded + "node M : X3DBoundedObject level 1 container c\n", 3, "needs @role(");
    EXPECT_EQ(compile("component C\n" + bounded + "node M : X3DBoundedObject level 1 container c @role(none)\n").output,
              "");
    // Two bases that differ.
    const std::string bases = "abstract P @acts(never) @role(light)\nabstract Q @acts(always) @role(view)\n";
    expectError(kHead + bases + "node M : P, Q level 1 container c @role(light)\n", 7,
                "@acts(never) and @acts(always)");
    expectError(kHead + bases + "node M : P, Q level 1 container c @acts(never)\n", 7, "@role(light) and @role(view)");
    EXPECT_EQ(compile(kHead + bases + "node M : P, Q level 1 container c @acts(never) @role(view)\n").output, "");
}

TEST_F(SpecCompiler, VersionsAndUnitsAreTagsToo) {
    const std::string field = kHead + "    SFFloat [in,out] x 0 ";
    EXPECT_EQ(
        compile(kHead + "node M : A level 1 container c @since(4.1)\n    SFVec3f [in,out] x 0 0 0 @none @unit(length) "
                        "@since(4.0)\n    retag a @since(3.3) @geometry\n")
            .output,
        "");
    expectError(kHead + "node M : A level 1 container c @since(5)\n", 5, "'5' is no version");
    expectError(kHead + "abstract B @since(4.0)\n", 5, "@since is of nodes and fields");
    expectError(field + "@none @since(2.1)\n", 5, "'2.1' is no version");
    expectError(field + "@none @unit(cubit)\n", 5, "'cubit' is no unit");
    expectError(field + "@none @light\n", 5, "'@light' is no tag of a field");
    expectError(field + "@unit(length)\n", 5, "field 'x' must have an aspect");
    expectError(kHead + "    SFInt32 [in,out] x 0 @none @unit(length)\n", 5, "values of SFInt32 have no unit");
    expectError(kHead + "    retag a @unit(length)\n", 5, "values of SFInt32 have no unit");
    expectError(kHead + "    retag a\n", 5, "retag ends in no tag");
    const std::string measured = kHead + "abstract B\n    SFFloat [in,out] x 0 @none @unit(length)\n";
    expectError(measured + "node M : B level 1 container c\n    SFFloat [in,out] x 1 @none\n", 8,
                "'x' is inherited with @unit(length): state its unit");
    EXPECT_EQ(compile(measured + "node M : B level 1 container c\n    SFFloat [in,out] x 1 @none @unit(none)\n").output,
              "");
}

TEST_F(SpecCompiler, WrongUseAndUnreadableFiles) {
    EXPECT_EQ(run("").status, 2);
    EXPECT_EQ(run("--header x.h").status, 2);
    EXPECT_EQ(run("--frobnicate x " + path("t.x3dspec")).status, 2);
    const CompilerOutcome missing =
        run("--header " + path("t.h") + " --source " + path("t.cpp") + ' ' + path("missing.x3dspec"));
    EXPECT_EQ(missing.status, 1);
    EXPECT_NE(missing.output.find("cannot be read"), std::string::npos) << missing.output;
    write("t.x3dspec", kHead);
    EXPECT_EQ(run("--skeleton Nobody " + path("t.x3dspec")).status, 1);
    EXPECT_EQ(run("--header /nonexistent/t.h --source " + path("t.cpp") + ' ' + path("t.x3dspec")).status, 1);
}

TEST_F(SpecCompiler, UnchangedOutputIsLeftAlone) {
    ASSERT_EQ(compile(kHead).status, 0);
    const auto before = std::filesystem::file_time_type::clock::now() - std::chrono::hours(1);
    std::filesystem::last_write_time(path("t.h"), before);
    ASSERT_EQ(compile(kHead + "# a comment\n").status, 0);
    EXPECT_EQ(std::filesystem::last_write_time(path("t.h")), before);
    ASSERT_EQ(compile(kHead + "    SFInt32 [in,out] x 0 @none\n").status, 0);
    EXPECT_NE(std::filesystem::last_write_time(path("t.h")), before);
}

TEST(OwnNodes, LookLikeBuiltInOnes) {
    const auto types = own::nodeTypes();
    ASSERT_EQ(types.size(), 1u);
    const NodeType& type = *types[0];
    EXPECT_EQ(type.name, own::Turntable::typeName);
    EXPECT_EQ(type.component, "Workshop");
    EXPECT_EQ(type.kind, NodeType::Kind::user);
    EXPECT_EQ(type.containerField, "children");
    for (const char* base : {"WorkshopTool", "X3DGroupingNode", "X3DBoundedObject", "X3DNode"})
        EXPECT_TRUE(type.isA(base)) << base;
    const auto check = [&](FieldIndex index, std::string_view name, FieldType fieldType, Aspect aspect) {
        ASSERT_LT(index, type.fields.size());
        EXPECT_EQ(type.fields[index].name, name);
        EXPECT_EQ(type.fields[index].type, fieldType);
        EXPECT_EQ(type.fields[index].aspect, aspect);
    };
    check(own::Turntable::axis.index, "axis", FieldType::SFVec3f, Aspect::transform);
    check(own::Turntable::children.index, "children", FieldType::MFNode, Aspect::structure);
    check(own::Turntable::type_.index, "type", FieldType::SFInt32, Aspect::none);
    check(own::Turntable::wear.index, "wear", FieldType::SFFloat, Aspect::none);
    check(own::Turntable::_since.index, "_since", FieldType::SFTime, Aspect::time);
    const auto& fields = type.fields;
    EXPECT_EQ(fields[own::Turntable::origin.index].defaultValue, Value(Vec3d(1e6, 0, -2.5)));
    const float quarter = static_cast<float>(std::numbers::pi / 2);
    EXPECT_EQ(fields[own::Turntable::profile.index].defaultValue, Value(Array<Vec2f>{{0, 0}, {0, quarter}}));
    EXPECT_EQ(fields[own::Turntable::drive.index].allowed, (std::vector<std::string>{"BELT", "DIRECT"}));
    EXPECT_EQ(fields[own::Turntable::stand.index].accepts, (std::vector<std::string>{"Turntable", "Shape"}));
    EXPECT_TRUE(fields[own::Turntable::type_.index].exclusiveMax);
    EXPECT_TRUE(fields[own::Turntable::_since.index].hidden);
}

TEST(OwnNodes, TheSkeletonOfABehaviourCompiles) {
    EXPECT_NE(own::turntableBehaviour().onEvent, nullptr);
    EXPECT_NE(own::turntableBehaviour().onTime, nullptr);
}
