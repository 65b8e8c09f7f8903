// Saving and loading again gives the same scene: for texts of our own and for files from elsewhere.
#include <algorithm>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>

#include <gmock/gmock.h>

#include <rtsg/core/field_text.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"
#include "documents/recording_handler.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using test::canonicalText;

std::string savedAs(const Scene& scene, Encoding encoding) {
    std::string text;
    Diagnostics problems("export");
    const auto writer = makeWriter(encoding, [&](std::string_view piece) { text += piece; }, problems);
    SceneExporter(scene, problems).write(*writer, encoding);
    EXPECT_EQ(problems.errors(), 0u) << test::allText(problems);
    return text;
}

void expectSameDocument(const Scene& scene, Encoding encoding, const std::filesystem::path& base,
                        bool loadInlines = true) {
    const std::string text = savedAs(scene, encoding);
    Scene again;
    Diagnostics problems("saved");
    LoadOptions options;
    options.loadInlines = loadInlines;
    loadText(again, text, problems, base, options);
    EXPECT_EQ(canonicalText(again), canonicalText(scene)) << text.substr(0, 3'000);
    // From then on saving gives the same file, byte for byte.
    const std::string second = savedAs(again, encoding);
    Scene third;
    loadText(third, second, problems, base, options);
    EXPECT_EQ(savedAs(third, encoding), second);
}

constexpr Encoding kTextEncodings[] = {Encoding::classicVrml, Encoding::xml};

/// Some value that no field has by default.
Value otherValue(const FieldDef& field) {
    const bool many = isMF(field.type);
    const FieldType one = sf(field.type);
    std::string text;
    for (int element = 0; element < (many ? 2 : 1); ++element) {
        if (one == FieldType::SFString)
            text += "\"" + (field.allowed.size() > 1 ? field.allowed[1] : std::string("a \\\" b")) + "\"";
        else if (one == FieldType::SFImage)
            text += "1 2 3 0xFF0102 0x3";
        else if (one == FieldType::SFBool)
            text += field.defaultValue == Value(true) || element == 1 ? "FALSE" : "TRUE";
        else
            for (int k = 0; k < info(one).components; ++k)
                text += one == FieldType::SFInt32 ? "3 " : k == 0 ? "0.625 " : "0.25 ";
        text += ' ';
    }
    auto value = parseFieldText(field.type, many ? "[ " + text + "]" : text);
    if (!value) ADD_FAILURE() << field.name << ": " << value.error().text;
    return value ? *value : Value();
}

// Names of fields mean something else in one encoding or another (style, name, class, id, url): each field that a
// document may give is given, written, read and compared.
TEST(RoundTrip, EveryFieldOfEveryNodeComesBackFromEveryEncoding) {
    std::size_t fields = 0;
    for (const std::unique_ptr<NodeType>& type : builtinTypes()) {
        if (type->name.starts_with("Rtsg")) continue;
        std::map<std::string, std::string> given;
        for (const Encoding encoding : {Encoding::classicVrml, Encoding::xml, Encoding::json}) {
            given.clear();
            std::string text;
            Diagnostics writing, reading;
            const auto writer = makeWriter(encoding, [&](std::string_view piece) { text += piece; }, writing);
            DocumentHeader header;
            header.version = "4.1", header.profile = "Full";
            writer->beginDocument(header);
            writer->beginNode(type->name, {}, {}, {});
            for (const FieldDef& field : type->fields) {
                const bool settable = field.access == Access::inputOutput || field.access == Access::initializeOnly;
                if (field.hidden || !settable || sf(field.type) == FieldType::SFNode) continue;
                const Value value = otherValue(field);
                given[field.name] = printFieldText(value);
                writer->setField(field.name, value, {});
            }
            writer->endNode({});
            writer->endDocument();
            test::RecordingHandler back;
            readDocument(text, back, reading);
            EXPECT_EQ(writing.errors() + reading.errors(), 0u) << test::allText(writing) << test::allText(reading);
            std::map<std::string, std::string> found;
            for (const std::string& line : back.lines) {
                std::istringstream words(line);
                std::string set, name, fieldType, value;
                words >> set >> name >> fieldType >> std::ws;
                std::getline(words, value);
                if (set == "set") found[name] = value;
            }
            EXPECT_EQ(found, given) << type->name << "\n" << text;
        }
        fields += given.size();
    }
    EXPECT_GT(fields, 1'000u);
}

// Straight from reader to writer, in the author's order: lists of declared fields beside a list that is open, and
// others that come back to it.
TEST(RoundTrip, DeclaredListsBesideOpenOnesComeBack) {
    const std::string text =
        "#X3D V4.0 utf8\nPROFILE Full\nShape { appearance Appearance { shaders ComposedShader {\n"
        "parts [ ShaderPart { type \"VERTEX\" } ]\n"
        "initializeOnly MFNode textures [ PixelTexture { } # between\n PixelTexture { repeatS FALSE } ]\n"
        "parts ShaderPart { type \"FRAGMENT\" }\n"
        "initializeOnly SFNode one PixelTexture { repeatT FALSE } language \"GLSL\"\n"
        "initializeOnly MFNode none [ ] initializeOnly MFNode more [ PixelTexture { } ] initializeOnly SFFloat f 3 } } "
        "}\n";
    Scene scene;
    Diagnostics problems;
    ASSERT_TRUE(loadText(scene, text, problems));
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::vrml97, Encoding::xml, Encoding::json}) {
        std::string written;
        Diagnostics writing, reading;
        readDocument(text, *makeWriter(encoding, [&](std::string_view piece) { written += piece; }, writing), writing);
        Scene again;
        EXPECT_TRUE(loadText(again, written, reading));
        EXPECT_EQ(reading.errors(), 0u) << test::allText(reading) << written;
        EXPECT_EQ(canonicalText(again), canonicalText(scene)) << written;
    }
}

// A Script or a peer may set such values, and no document can express them.
TEST(RoundTrip, ValuesThatAreNotFiniteAreLeftOutAndNamed) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
    Scene scene;
    Diagnostics problems;
    ASSERT_TRUE(loadText(scene,
                         "#X3D V4.0 utf8\nPROFILE Full\nDEF T Transform { scale 2 2 2 children Shape { geometry "
                         "PointSet { coord DEF C Coordinate { point [ 1 2 3, 4 5 6 ] } } } }\n"
                         "DEF CLOCK TimeSensor { cycleInterval 3 }\n"
                         "DEF S Script { inputOutput SFDouble own 4 inputOutput MFVec2d pair [ 1 2 ] }\n",
                         problems))
        << test::allText(problems);
    const Scene& constant = scene;
    const auto set = [&](const char* node, const char* field, const Value& value) {
        const NodeId id = scene.findName(node);
        ASSERT_TRUE(scene.setField(id, constant.node(id).type().findExact(field), value)) << node << '.' << field;
    };
    set("T", "translation", Value(Vec3f(float(nan), float(infinity), 1)));
    set("C", "point", Value(Array<Vec3f>{Vec3f(1, 2, 3), Vec3f(4, float(-infinity), 6)}));
    set("CLOCK", "stopTime", Value(Time{infinity}));
    set("S", "own", Value(nan));
    set("S", "pair", Value(Array<Vec2d>{Vec2d(1, infinity)}));
    for (const Encoding encoding : {Encoding::classicVrml, Encoding::vrml97, Encoding::xml, Encoding::json}) {
        std::string text;
        Diagnostics writing, reading;
        const auto writer = makeWriter(encoding, [&](std::string_view piece) { text += piece; }, writing);
        SceneExporter(scene, writing).write(*writer, encoding);
        EXPECT_EQ(writing.errors(), 5u) << test::allText(writing);
        for (const char* reported : {"T.translation holds nan", "C.point holds -inf", "CLOCK.stopTime holds inf",
                                     "S.own holds nan", "S.pair holds inf"})
            EXPECT_THAT(test::allText(writing), testing::HasSubstr(reported));
        EXPECT_THAT(test::allText(writing), testing::HasSubstr("[write]"));
        Scene again;
        EXPECT_TRUE(loadText(again, text, reading)) << text;
        EXPECT_EQ(reading.errors(), 0u) << test::allText(reading) << text;
        const auto value = [&](const char* node, const char* field) {
            const Node& read = again.node(again.findName(node));
            return printFieldText(read.value(read.type().findExact(field)));
        };
        EXPECT_EQ(value("T", "translation"), "0 0 0");
        EXPECT_EQ(value("T", "scale"), "2 2 2");
        EXPECT_EQ(value("C", "point"), "[]");
        EXPECT_EQ(value("CLOCK", "cycleInterval"), "3");
        EXPECT_EQ(value("S", "own"), "0");
    }
}

struct NamedText {
    const char* name;
    const char* text;
};

class RoundTripText : public testing::TestWithParam<NamedText> {};

TEST_P(RoundTripText, GivesTheSameScene) {
    test::Loaded l(GetParam().text);
    ASSERT_EQ(l.diagnostics.errors(), 0u) << l.problems();
    for (const Encoding encoding : kTextEncodings) expectSameDocument(l.scene, encoding, {});
}

INSTANTIATE_TEST_SUITE_P(
    Texts, RoundTripText,
    testing::Values(
        NamedText{"Empty", ""},
        NamedText{"Head",
                  "PROFILE Immersive COMPONENT Geospatial:1 META \"a\" \"b & <c> \\\"d\\\"\" "
                  "UNIT length km 1000.0 Group { }"},
        NamedText{"Fields",
                  "DEF T Transform { translation 0.1 -2e-20 3e10 rotation 0.577 0.577 0.577 1 visible FALSE }\n"
                  "WorldInfo { title \"q\\\"uo\\\\te\" info [ \"\" \"a, b\" \"<&>\" ] }\n"
                  "Shape { geometry IndexedFaceSet { coordIndex [ 0 1 2 -1 ] coord Coordinate { point [ 0 0 0, "
                  "1 0 0, 0 1 0 ] } } appearance Appearance { texture PixelTexture { image 1 2 3 0xFF0000 "
                  "0x00FF00 } } }"},
        NamedText{"Sharing",
                  "DEF A Group { children [ DEF S Shape { geometry DEF B Box { } } Group { children USE S } ] }\n"
                  "Group { children [ USE S USE A ] } Shape { geometry USE B }"},
        NamedText{"Routes",
                  "DEF C TimeSensor { loop TRUE } DEF P PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0 1 1 1 ] "
                  "} DEF T Transform { }\nROUTE C.fraction_changed TO P.set_fraction\n"
                  "ROUTE P.value_changed TO T.set_translation ROUTE T.translation TO T.center"},
        NamedText{"Script",
                  "DEF T Transform { }\nDEF S Script { inputOutput SFFloat a 1.5 inputOnly SFTime t outputOnly "
                  "MFVec3f out initializeOnly MFNode kids [ USE T Shape { } ] inputOutput SFNode me USE S "
                  "initializeOnly MFString s [ \"x\" \"y\" ] initializeOnly SFNode none NULL mustEvaluate TRUE "
                  "url \"ecmascript: function f() { return '<&\\\"'; }\" }"},
        NamedText{"Proto",
                  "PROTO P [ inputOutput SFVec3f at 1 2 3 initializeOnly MFNode c [ DEF D Shape { } ] inputOnly "
                  "SFBool in outputOnly SFTime out ] { DEF T Transform { translation IS at children IS c } "
                  "DEF X TimeSensor { enabled IS in startTime IS out } ROUTE X.startTime TO X.stopTime }\n"
                  "PROTO Q [ initializeOnly MFNode k [ ] ] { PROTO R [ ] { Group { } } Group { children [ R { } "
                  "P { c IS k } ] } }\n"
                  "DEF A P { } DEF B P { at 4 5 6 c [ DEF S Shape { } USE S ] } P { c [ ] } DEF E Q { k USE S } "
                  "Group { children USE A } ROUTE A.at TO B.at"},
        NamedText{"UnusedProto",
                  "PROTO P [ inputOutput SFFloat f 1 ] { Group { } } EXTERNPROTO X [ inputOutput SFInt32 i ] "
                  "[ \"nowhere.x3d#X\" \"b.x3d\" ] Group { }"},
        NamedText{"ProtoAppearance",
                  "PROTO A [ initializeOnly SFColor c 1 0 0 ] { Appearance { material Material { "
                  "diffuseColor IS c } } }\nShape { appearance A { c 0 1 0 } geometry Box { } }"},
        NamedText{"Metadata",
                  "Group { metadata MetadataSet { name \"m\" value [ MetadataInteger { name \"i\" value [ 1 2 3 ] } "
                  "MetadataString { value [ \"a\" \"b\" ] } ] } }"}),
    [](const auto& param) { return std::string(param.param.name); });

TEST(RoundTrip, NamelessSharedAndRoutedNodesGetNames) {
    Scene scene;
    const NodeId a = *scene.createNode("Transform"), b = *scene.createNode("Transform"), c = *scene.createNode("Group");
    const FieldIndex rootChildren = scene.node(scene.root()).type().find("children");
    const FieldIndex children = scene.node(c).type().find("children");
    const FieldIndex translation = scene.node(a).type().find("translation");
    ASSERT_TRUE(scene.insertChild(scene.root(), rootChildren, a));
    ASSERT_TRUE(scene.insertChild(scene.root(), rootChildren, c));
    ASSERT_TRUE(scene.insertChild(c, children, a));
    ASSERT_TRUE(scene.insertChild(c, children, b));
    ASSERT_TRUE(scene.setName(c, "_1"));
    ASSERT_TRUE(scene.addRoute(a, translation, b, translation));
    test::Loaded again(savedAs(scene, Encoding::classicVrml));
    EXPECT_EQ(again.problems(), "");
    EXPECT_EQ(again.scene.nodeCount(), scene.nodeCount());
    EXPECT_EQ(again.scene.routeCount(), 1u);
    EXPECT_EQ(again.nodes(again.named("_1"), "children")[0], again.roots()[0]);
}

TEST(RoundTrip, AReplicaSavesTheSameDocument) {
    test::Loaded l(
        "PROFILE Immersive META \"k\" \"v\"\n"
        "PROTO P [ inputOutput SFVec3f at 1 2 3 initializeOnly MFNode c [ Shape { } ] ] { Transform { "
        "translation IS at children IS c } }\nDEF A P { at 3 2 1 } DEF B P { c [ ] }\n"
        "DEF S Script { outputOnly SFVec3f o } ROUTE S.o TO A.at");
    ASSERT_EQ(l.problems(), "");
    l.scene.newFrame(0);
    Scene replica;
    ASSERT_TRUE(replica.apply(std::make_shared<ChangeSet>(l.scene.snapshot())));
    for (const Encoding encoding : kTextEncodings) EXPECT_EQ(savedAs(replica, encoding), savedAs(l.scene, encoding));
}

// ---- files from elsewhere ----------------------------------------------------------------------------------------

std::filesystem::path folderOfScenes() {
    if (const char* given = std::getenv("RTSG_SCENES")) return given;
    return RTSG_SOURCE_DIR "/../shared/scenes";
}

std::vector<std::string> filesOfScenes() {
    std::vector<std::string> files;
    std::error_code problem;
    for (std::filesystem::recursive_directory_iterator it(folderOfScenes(), problem), end; !problem && it != end;
         ++it) {
        const std::string extension = it->path().extension().string();
        if (extension.starts_with(".x3d") || extension == ".wrl" || extension == ".gz")
            files.push_back(std::filesystem::relative(it->path(), folderOfScenes()).string());
    }
    std::ranges::sort(files);
    return files;
}

/// The parts that an encoding cannot express. Everything else in these files must survive.
std::string_view exception(std::string_view file, Encoding encoding) {
    if (file == "pythonSAI/HelloWorldProgramOutput.x3d" && encoding == Encoding::classicVrml)
        return "its DEF names contain '.', which ClassicVRML does not allow";
    return {};
}

TEST(RoundTrip, FilesFromElsewhere) {
    const std::vector<std::string> files = filesOfScenes();
    if (files.empty()) GTEST_SKIP() << "no scenes in " << folderOfScenes() << "; set RTSG_SCENES";
    for (const std::string& file : files)
        for (const Encoding encoding : kTextEncodings) {
            if (!exception(file, encoding).empty()) continue;
            SCOPED_TRACE(file + (encoding == Encoding::xml ? " as XML" : " as ClassicVRML"));
            Scene scene;
            Diagnostics problems;
            LoadOptions options;
            options.loadInlines = false;  // their content is not part of the document
            ASSERT_TRUE(loadFile(scene, folderOfScenes() / file, problems, options));
            expectSameDocument(scene, encoding, (folderOfScenes() / file).parent_path(), false);
        }
}

}  // namespace
}  // namespace rtsg
