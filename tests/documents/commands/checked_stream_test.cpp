// Streams of commands in any order come out as documents that keep the rules, and what was right comes out whole.
#include "commands/checked_stream.h"

#include <limits>
#include <random>

#include <gtest/gtest.h>

#include <rtsg/documents/loader.h>

#include "documents/recording_handler.h"

namespace rtsg::test {
namespace {

using detail::CheckedStream;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

std::string complaints(const Diagnostics& diagnostics) {
    std::string all;
    for (const Diagnostic& one : diagnostics.all()) all += one.text + '\n';
    return all;
}

struct Checked {
    RecordingHandler handler;
    Diagnostics diagnostics;
    CheckedStream stream{handler, "test", nullptr, diagnostics};
};

TEST(CheckedStream, PassesOnWhatIsRight) {
    Checked c;
    c.stream.beginDocument({});
    c.stream.meta("title", "t", {});
    c.stream.beginProto("P", {});
    c.stream.declareField({Access::inputOutput, FieldType::SFFloat, "f", {}}, Value(1.0f), {});
    c.stream.beginProtoBody({});
    c.stream.beginNode("Group", {}, {}, {});
    c.stream.endNode({});
    c.stream.endProto({});
    c.stream.beginNode("Script", "S", {}, {});
    c.stream.declareField({Access::outputOnly, FieldType::SFFloat, "out", {}}, std::nullopt, {});
    c.stream.endNode({});
    c.stream.beginNode("P", {}, {}, {});
    c.stream.setField("f", Value(2.0f), {});
    c.stream.endNode({});
    c.stream.beginNode("Transform", "T", {}, {});
    c.stream.useNode("S", "children", {});
    c.stream.setField("scale", Value(Vec3f(2)), {});
    c.stream.endNode({});
    c.stream.route("S", "out", "T", "set_translation", {});
    c.stream.endDocument();
    c.stream.close(true);
    EXPECT_EQ(complaints(c.diagnostics), "");
    EXPECT_TRUE(c.handler.complete()) << c.handler.violation;
    EXPECT_EQ(c.handler.lines.size(), 18u) << c.handler.text();
}

TEST(CheckedStream, LeavesOutWhatIsWithinANodeThatItRefuses) {
    Checked c;
    c.stream.beginNode("no name", {}, {}, {});
    c.stream.setField("a", Value(true), {});
    c.stream.beginNode("Group", {}, "children", {});
    c.stream.beginProto("P", {});
    c.stream.endProto({});
    c.stream.endNode({});
    c.stream.endNode({});
    c.stream.beginNode("Group", {}, {}, {});
    c.stream.endNode({});
    c.stream.endDocument();
    c.stream.close(true);
    EXPECT_EQ(complaints(c.diagnostics), "the reader of test files gives 'no name' as a name, which it is not\n");
    EXPECT_EQ(c.handler.text(), "begin Group\nend\n");
}

TEST(CheckedStream, AuthorsMayCallNodesWhatTheyLike) {
    Checked c;
    c.stream.beginNode("Group", "Material #30", {}, {});
    c.stream.endNode({});
    c.stream.route("Material #30", "a", "it's [one]", "b", {});
    c.stream.beginNode("Group", "a\nb", {}, {});
    c.stream.endNode({});
    c.stream.endDocument();
    c.stream.close(true);
    EXPECT_EQ(complaints(c.diagnostics), "the reader of test files gives 'a\nb' as a name, which it is not\n");
    EXPECT_EQ(c.handler.text(), "begin Group DEF Material #30\nend\nroute Material #30.a it's [one].b\n");
}

TEST(CheckedStream, MendsNumbersAndTexts) {
    Checked c;
    c.stream.beginNode("Viewpoint", {}, {}, {});
    c.stream.setField("position", Value(Vec3f(kNaN, 1, std::numeric_limits<float>::infinity())), {});
    c.stream.setField("description", Value(String("a\xFF")), {});
    c.stream.endNode({});
    c.stream.endDocument();
    c.stream.close(true);
    EXPECT_EQ(complaints(c.diagnostics),
              "2 numbers of the test file are not finite; 0 is taken instead\n"
              "1 bytes of the test file's texts are not valid UTF-8 (or zero)\n");
    EXPECT_NE(c.handler.text().find("0 1 0"), std::string::npos) << c.handler.text();
    EXPECT_NE(c.handler.text().find("a\xEF\xBF\xBD"), std::string::npos) << c.handler.text();
}

TEST(CheckedStream, ADocumentThatIsNotEndedIsEnded) {
    for (const bool complete : {true, false}) {
        Checked c;
        c.stream.beginNode("Group", {}, {}, {});
        c.stream.close(complete);
        EXPECT_TRUE(c.handler.complete());
        EXPECT_EQ(complaints(c.diagnostics), complete ? "the reader of test files does not end its document\n" : "");
    }
    Checked nothing;
    nothing.stream.close(true);
    EXPECT_EQ(nothing.handler.lines.size(), 0u);
    EXPECT_EQ(complaints(nothing.diagnostics), "");
}

/// A reader of nonsense, drawn by chance.
void pushAnything(DocumentHandler& to, std::mt19937& random) {
    const auto any = [&](std::initializer_list<std::string_view> all) { return all.begin()[random() % all.size()]; };
    const auto name = [&] { return any({"A", "B", "", "no name", "\xFF", "children", "geometry", "radius"}); };
    const auto type = [&] { return any({"Group", "Shape", "Sphere", "Script", "P", "", "a b"}); };
    const auto value = [&]() -> Value {
        switch (random() % 6) {
            case 0:
                return Value(kNaN);
            case 1:
                return Value(NodeId{7});
            case 2:
                return Value(Array<NodeId>());
            case 3:
                return Value(String("\xC0"));
            case 4:
                return Value(Array<String>{String("ok"), String("\xC0")});
            default:
                return Value(Vec3f(1));
        }
    };
    switch (random() % 20) {
        case 0:
            return to.beginDocument({});
        case 1:
            return random() % 8 ? void() : to.endDocument();
        case 2:
            return to.component(name(), 1, {});
        case 3:
            return to.unit("length", name(), random() % 2 ? 1 : std::numeric_limits<double>::quiet_NaN(), {});
        case 4:
            return to.endProto({});
        case 5:
            return to.beginProto(name(), {});
        case 6:
            return to.beginProtoBody({});
        case 7:
            return to.declareField({Access::inputOutput, FieldType::SFFloat, std::string(name()), {}}, value(), {});
        case 8:
            return to.route(name(), name(), name(), name(), {});
        case 9:
            return to.externProto(name(), {{Access::inputOnly, FieldType::SFBool, std::string(name()), {}}}, {"\xFF"},
                                  {});
        case 10:
            return to.isConnection(name(), name(), {});
        case 11:
            return to.importNode(name(), name(), name(), {});
        case 12:
            return to.comment("\xFF", {});
        case 13:
        case 14:
            return to.endNode({});
        case 15:
            return to.useNode(name(), name(), {});
        case 16:
            return to.setField(name(), value(), {});
        default:
            return to.beginNode(type(), name(), name(), {});
    }
}

TEST(CheckedStream, AnyCommandsMakeADocumentThatKeepsTheRules) {
    for (unsigned seed = 0; seed < 300; ++seed) {
        std::mt19937 random(seed);
        Checked c;
        for (int i = 0; i < 60; ++i) pushAnything(c.stream, random);
        c.stream.close(random() % 2 != 0);
        EXPECT_EQ(c.handler.violation, "") << "seed " << seed;
        EXPECT_TRUE(c.handler.lines.empty() || c.handler.complete()) << "seed " << seed;
        // A builder and a writer take it, too.
        std::mt19937 again(seed);
        Scene scene;
        Diagnostics diagnostics;
        auto dialect = std::make_shared<Dialect>();
        dialect->add(FormatReader{.name = "chance",
                                  .recognises = [](const FormatClue&) { return true; },
                                  .read =
                                      [&](FormatSource&, DocumentHandler& to, Diagnostics&) {
                                          for (int i = 0; i < 60; ++i) pushAnything(to, again);
                                          return true;
                                      }});
        registerDocuments(scene, dialect);
        (void)loadText(scene, "any", diagnostics);
        scene.newFrame(0);
    }
}

}  // namespace
}  // namespace rtsg::test
