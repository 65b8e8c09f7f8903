// Documents that arrive in blocks: whatever the blocks' size, the same commands, positions and complaints as from
// memory; and what has been read is given back.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <random>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zlib.h>

#include <rtsg/core/resource.h>
#include <rtsg/documents/filter.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/writer.h>

#include "core/scene_check.h"
#include "documents/recording_handler.h"
#include "read/reader_bytes.h"
#include "read/text_feed.h"

namespace rtsg {
namespace {

using test::RecordingHandler;

std::string filePath(const std::string& name) {
    return (std::filesystem::path(testing::TempDir()) / ("streaming_" + std::to_string(::getpid()) + name)).string();
}

class TemporaryFile {
  public:
    TemporaryFile(const std::string& name, std::string_view content) : path(filePath(name)) {
        std::ofstream(path, std::ios::binary) << content;
    }
    ~TemporaryFile() { std::filesystem::remove(path); }
    TemporaryFile(const TemporaryFile&) = delete;
    TemporaryFile& operator=(const TemporaryFile&) = delete;
    const std::string path;
};

struct Outcome {
    std::string commands, problems;
    std::vector<std::string> locations;
    bool complete = false;
};

Outcome outcome(const RecordingHandler& handler, const Diagnostics& problems, bool complete) {
    Outcome result{handler.text(), test::allText(problems), {}, complete};
    for (const SourceLocation& where : handler.positions)
        result.locations.push_back(std::to_string(where.line) + ":" + std::to_string(where.column));
    return result;
}

Outcome fromMemory(std::string_view text) {
    RecordingHandler handler;
    Diagnostics problems("test");
    const bool complete = readDocument(text, handler, problems);
    return outcome(handler, problems, complete);
}

Outcome inBlocks(const std::string& path, std::size_t block) {
    RecordingHandler handler;
    Diagnostics problems("test");
    const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    const bool complete = detail::readDescriptorInBlocks(descriptor, block, {}, handler, problems, {});
    ::close(descriptor);
    return outcome(handler, problems, complete);
}

void expectSame(std::string_view text) {
    const Outcome whole = fromMemory(text);
    const TemporaryFile file("a", text);
    for (const std::size_t block : {std::size_t{1}, std::size_t{2}, std::size_t{3}, std::size_t{7}, std::size_t{64},
                                    std::size_t{4099}, std::size_t{1} << 20}) {
        const Outcome parts = inBlocks(file.path, block);
        EXPECT_EQ(parts.commands, whole.commands) << "blocks of " << block;
        EXPECT_EQ(parts.problems, whole.problems) << "blocks of " << block;
        EXPECT_EQ(parts.locations, whole.locations) << "blocks of " << block;
        EXPECT_EQ(parts.complete, whole.complete) << "blocks of " << block;
    }
}

/// More than what decides the encoding, so that blocks matter behind it.
std::string padded(std::string_view head, std::string_view body, std::string_view comment) {
    std::string text(head);
    while (text.size() < 6000) text += comment;
    return text + std::string(body);
}

constexpr const char* kClassicBody = R"(
DEF T Transform { translation 1.25e-3 -2 3 rotation 0 1 0 1.5707963 # a comment
  children [ DEF S Shape { geometry IndexedFaceSet { coordIndex [ 0, 1, 2, -1 0 2 3 -1 ] coord Coordinate {
    point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0.333333333333333333333333333 ] } } } USE S ] }
WorldInfo { title "ÄÖÜ \"quoted\" \\ # no comment" info [ "one", "two" ] }
Unknown { a 1 2 3 b [ "x" ] c Group { } d [ 0x10 ] }
PROTO P [ inputOutput SFFloat f 1 ] { Group { } } P { f 2 }
Shape { geometry Box { size 1 x 3 nothing 7 } }
ROUTE T.translation_changed TO T.set_center
Script { url "ecmascript: function f() { return 1; }" inputOnly SFBool in } PixelTexture { image 2 1 1 0xFF 0x01 }
Group { children [ Group { )";

TEST(Streaming, ClassicVrmlIsTheSameWhateverTheBlocks) {
    expectSame(padded("#X3D V4.0 utf8\nPROFILE Full\n", kClassicBody, "# ñ padding\n"));
    expectSame("#X3D V4.0 utf8");
    expectSame("");
}

TEST(Streaming, XmlIsTheSameWhateverTheBlocks) {
    const std::string body =
        "<Scene><Transform DEF='T' translation='1 2 3'><Shape><IndexedFaceSet coordIndex='0 1 2 -1'><Coordinate "
        "point='0 0 0, 1 0 0 &#10; 1 1 0'/></IndexedFaceSet></Shape><!-- ' > \" --></Transform>\n"
        "<WorldInfo title='a &lt; b' info='\"ä\" \"ö\"'/><Box size='1 x 2' wrong='3'/>\n"
        "<Script><![CDATA[ if (a > b && c < d) \"'; ]]></Script><?pi a='>' ?>\n"
        "<ROUTE fromNode='T' fromField='translation' toNode='T' toField='center'/></Scene></X3D>\n";
    const std::string head =
        "<?xml version='1.0' encoding='UTF-8'?>\n<!DOCTYPE X3D [ <!ENTITY e \"1 > 2\"> <!-- ]> --> ]>\n"
        "<X3D version='4.0' profile='Full'>";
    expectSame(padded(head, body, "<!-- ñ padding -->\n"));
    expectSame(padded(head, "<Scene><Group><Shape></Group></Scene></X3D>", "<!-- padding -->\n"));
    expectSame(padded(head, "<Scene><Group DEF='a", "<!-- padding -->\n"));
}

TEST(Streaming, JsonIsTheSameWhateverTheBlocks) {
    expectSame(R"({"X3D":{"@version":"4.0","@profile":"Full","Scene":{"-children":[{"Shape":{"-geometry":{"Box":)"
               R"({"@size":[1,2,3]}}}},{"#comment":"ä"},{"WorldInfo":{"@title":"ö"}}]}}})");
}

std::string jsonScene(const std::string& members) {
    return R"({"X3D":{"encoding":"UTF-8","@version":"4.0","@profile":"Full","JSON schema":"none","Scene":{)" + members +
           "}}}\n";
}

std::string jsonNumbers(std::size_t count, const std::string& separator = ",") {
    std::string text;
    for (std::size_t i = 0; i < count; ++i) text += (i ? separator : "") + std::to_string(i % 1000) + ".5";
    return text;
}

TEST(Streaming, JsonOfEveryShapeIsTheSameWhateverTheBlocks) {
    const std::string padding = R"({"#comment":")" + std::string(6000, 'x') + R"("},)";
    expectSame(
        jsonScene(R"("-children":[)" + padding +
                  R"({"Transform":{"@DEF":"T","@translation":[1,2,3],"-children":[{"Shape":{"-geometry":)"
                  R"({"IndexedFaceSet":{"@coordIndex":[0,1,2,-1],"-coord":{"Coordinate":{"@point":[0,0,0, 1,)"
                  R"(0,0,1,1,0]}}}}}}]}},{"WorldInfo":{"@title":"a \"b\" ä \\","@info":["x]","y\u00e9"]}},)"
                  R"({"Script":{"#sourceCode":["a{","b\"]"]}},{"Box":{"@size":[1,"x",2],"@wrong":3}}],)"
                  R"("ROUTE":[{"@fromNode":"T","@fromField":"translation","@toNode":"T","@toField":"center"}])"));
    expectSame(jsonScene(R"("-children":[)" + padding + R"({"Group":{"-children":[{"Shape":{)"));
    expectSame(jsonScene(R"("-children":[)" + padding + R"({"Group":{"-children":[{"Shape":{]}}])"));
    expectSame(jsonScene(R"("-children":[)" + padding + R"({"WorldInfo":{"@title":"not closed)"));
}

TEST(Streaming, JsonAttributesMayStandBehindChildren) {
    const std::string late = jsonScene(
        R"("-children":[{"Transform":{"-children":[{"Shape":{"-geometry":{"Box":{"@size":[1,2,3]}}}}],)"
        R"("@translation":[1,2,3],"@DEF":"T"}},{"Shape":{"-geometry":{"PointSet":{"-coord":{"Coordinate":{"#comment":"c",)"
        R"("@point":[)" +
        jsonNumbers(3000) + R"(]}}}}}}])");
    const std::string early = jsonScene(
        R"("-children":[{"Transform":{"@translation":[1,2,3],"@DEF":"T","-children":[{"Shape":{"-geometry":{"Box":)"
        R"({"@size":[1,2,3]}}}}]}},{"Shape":{"-geometry":{"PointSet":{"-coord":{"Coordinate":{"@point":[)" +
        jsonNumbers(3000) + R"(],"#comment":"c"}}}}}}])");
    EXPECT_EQ(fromMemory(late).commands, fromMemory(early).commands);
    EXPECT_EQ(fromMemory(late).problems, "");
    expectSame(late);
    // Also for the whole document.
    expectSame(R"({"X3D":{"Scene":{"-children":[{"Group":{}}]},"@version":"4.0","@profile":"Full"}})");
    EXPECT_EQ(
        fromMemory(R"({"X3D":{"Scene":{"-children":[{"Group":{}}]},"@version":"4.0","@profile":"Full"}})").commands,
        fromMemory(R"({"X3D":{"@version":"4.0","@profile":"Full","Scene":{"-children":[{"Group":{}}]}}})").commands);
}

std::string jsonPoints(const std::string& array) {
    return jsonScene(R"("-children":[{"Shape":{"-geometry":{"PointSet":{"-coord":{"Coordinate":{"@DEF":"C","@point":)" +
                     array + "}}}}}}]");
}

TEST(Streaming, LongJsonListsAreReadInPlaceWithTheSameValues) {
    // From 16 KiB on lists are read in place; half of this one is longer, too.
    const std::string flat = jsonPoints("[" + jsonNumbers(6000) + "]");
    std::string nested = "[";
    for (int i = 0; i < 2000; ++i) {
        const auto number = [](int k) { return std::to_string(k % 1000) + ".5"; };
        nested += (i ? ",\n[" : "[") + number(3 * i) + ", " + number(3 * i + 1) + "," + number(3 * i + 2) + "]";
    }
    const Outcome expected = fromMemory(flat);
    EXPECT_EQ(expected.problems, "");
    EXPECT_EQ(fromMemory(jsonPoints(nested + "]")).commands, expected.commands);
    EXPECT_EQ(fromMemory(jsonPoints("[" + jsonNumbers(6000, " ,\n\t") + " ]")).commands, expected.commands);
    // Brackets that come late in what looked like a plain list.
    const std::string half = jsonNumbers(3000), first = "0.5,1.5,2.5";
    ASSERT_GT(half.size(), std::size_t{1} << 14);
    ASSERT_TRUE(half.starts_with(first));
    const std::string late = jsonPoints("[" + half + ",[" + first + "]" + half.substr(first.size()) + "]");
    EXPECT_EQ(fromMemory(late).commands, expected.commands);
    expectSame(flat);
    expectSame(jsonPoints(nested + "]"));
    expectSame(late);
}

TEST(Streaming, FaultsInLongJsonListsAreReportedWhereTheyAre) {
    const auto problems = [](const std::string& array) {
        const std::string text = jsonPoints(array);
        expectSame(text);
        return fromMemory(text).problems;
    };
    using testing::HasSubstr;
    const std::string head = "[\n" + jsonNumbers(3000), tail = jsonNumbers(3000) + "]";
    EXPECT_THAT(problems(head + ",\n  x,\n" + tail), HasSubstr("test:3:3"));
    EXPECT_THAT(problems(head + "\n 7,\n" + tail), HasSubstr("test:3:2: error: a comma is missing before this"));
    EXPECT_THAT(problems(head + ",\n ,8,\n" + tail), HasSubstr("test:3:2: error: a comma too many"));
    EXPECT_THAT(problems(head + ",\n]"), HasSubstr("test:3:1: error: there is nothing between the last comma"));
    EXPECT_THAT(problems(head + ",\n \"8\",\n" + tail), HasSubstr("test:3:2"));
    EXPECT_THAT(problems(head + ",\n {\"a\":[1]},\n" + tail), HasSubstr("test:3:2"));
    EXPECT_THAT(problems(head + ",\n [1,2,3}" + tail), HasSubstr("not well-formed JSON: the bracket matches none"));
    EXPECT_THAT(problems(head + ",\n"), HasSubstr("there is nothing between the last comma"));
}

/// Commas, white space and numbers by chance, looked at 64 bytes at a time and one by one.
TEST(Streaming, CommaFaultsOfJsonAreTheSameInALongListAndInAShortOne) {
    std::mt19937 random(20261120);
    for (int round = 0; round < 300; ++round) {
        std::string list;
        const int faults = round % 3;
        for (int i = 0; i < 40; ++i) {
            list += std::string(random() % 4, ' ') + std::to_string(random() % 100'000);
            list += std::string(random() % 4, random() % 2 ? ' ' : '\n') + ',';
        }
        list += "1";
        for (int i = 0; i < faults; ++i) list[random() % (list.size() - 1)] = random() % 2 ? ',' : ' ';
        const std::string text = jsonPoints("[" + list + "]");
        // A bracket ends the look at many bytes; so does the end of a block.
        const TemporaryFile file("r", text);
        EXPECT_EQ(inBlocks(file.path, 5).problems, fromMemory(text).problems) << text;
    }
}

/// Wherever in the 64 bytes that are looked at in one the last comma stands.
TEST(Streaming, ACommaBeforeTheBracketIsFoundAtEveryPlace) {
    for (std::size_t spaces = 0; spaces < 130; ++spaces) {
        const std::string list = "[1" + std::string(spaces, ' ') + "," + jsonNumbers(59);
        EXPECT_EQ(fromMemory(jsonPoints(list + "]")).problems, "") << spaces;
        EXPECT_THAT(fromMemory(jsonPoints(list + ",]")).problems, testing::HasSubstr("nothing between the last comma"))
            << spaces;
        EXPECT_THAT(fromMemory(jsonPoints(list + " 1]")).problems, testing::HasSubstr("a comma is missing")) << spaces;
    }
}

TEST(Streaming, JsonThroughAPipeIsKeptAsAWhole) {
    const std::string text = jsonPoints("[" + jsonNumbers(2000) + "]");
    int ends[2];
    ASSERT_EQ(::pipe(ends), 0);
    ASSERT_EQ(::write(ends[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
    ::close(ends[1]);
    RecordingHandler handler;
    Diagnostics problems("test");
    EXPECT_TRUE(detail::readDescriptorInBlocks(ends[0], 1000, {}, handler, problems, {}));
    ::close(ends[0]);
    EXPECT_EQ(handler.text(), fromMemory(text).commands);
}

TEST(Streaming, BytesThatAreNoUtf8AreReplacedAcrossBlocks) {
    for (const std::string& bad :
         {std::string("\xC3"), std::string("\xE2\x82"), std::string("\xF0\x9F\x98"), std::string("\xFF\xFE\x80"),
          std::string(1, '\0'), std::string("\xC3\x28\xE2\x82\xAC")}) {
        expectSame(padded("#X3D V4.0 utf8\n",
                          "WorldInfo { title \"x" + bad + "y€\" }\nWorldInfo { title \"" + bad + "\" }", "# ñ\n"));
    }
}

TEST(Streaming, GzipIsTheSameInMembersAndTruncated) {
    const std::string text = padded("#X3D V4.0 utf8\n", kClassicBody, "# padding\n");
    const std::string path = filePath("z.x3dvz");
    gzFile out = gzopen(path.c_str(), "wb");
    gzwrite(out, text.data(), 3000);
    gzclose(out);
    out = gzopen(path.c_str(), "ab");  // a second member
    gzwrite(out, text.data() + 3000, static_cast<unsigned>(text.size() - 3000));
    gzclose(out);
    const Outcome whole = fromMemory(text);
    for (const std::size_t block : {1, 7, 4096}) EXPECT_EQ(inBlocks(path, block).commands, whole.commands) << block;
    std::filesystem::resize_file(path, std::filesystem::file_size(path) - 20);
    EXPECT_THAT(inBlocks(path, 64).problems, testing::HasSubstr("truncated"));
    std::filesystem::remove(path);
}

/// Takes what comes and keeps the last list of numbers.
class LastValue final : public Filter {
  public:
    Value last;
    std::vector<std::string> names;
    void setField(std::string_view name, Value value, SourceLocation) override {
        names.emplace_back(name);
        if (isMF(value.type())) last = std::move(value);
    }
};

std::string manyNumbers(std::size_t count, const char* separator) {
    std::string text;
    for (std::size_t i = 0; i < count; ++i) text += std::to_string(i % 1000) + "." + std::to_string(i % 7) + separator;
    return text;
}

TEST(Streaming, LongListsAreReadPastExpatWithTheSameValues) {
    constexpr std::size_t count = 90'000;  // 540 KB: many times what makes an attribute long
    for (const char* separator : {" ", ",\n", "&#10;", " &#x20;\t"}) {
        const std::string numbers = manyNumbers(count, separator);
        const std::string text = "<X3D version='4.0'><Scene><Shape><IndexedFaceSet coordIndex='" +
                                 [] {
                                     std::string list;
                                     for (int i = 0; i < 40'000; ++i) list += std::to_string(i % 30'000) + " ";
                                     return list;
                                 }() +
                                 "' solid='false' texCoordIndex = \"0 1 2\"><Coordinate DEF='C' point='" + numbers +
                                 "'/></IndexedFaceSet></Shape><WorldInfo title='behind'/></Scene></X3D>";
        const TemporaryFile file("long.x3d", text);
        LastValue whole, parts;
        Diagnostics problems("test");
        readDocument(text, whole, problems);
        const int descriptor = ::open(file.path.c_str(), O_RDONLY | O_CLOEXEC);
        detail::readDescriptorInBlocks(descriptor, 1 << 14, {}, parts, problems, {});
        ::close(descriptor);
        EXPECT_EQ(test::allText(problems), "");
        EXPECT_EQ(whole.names, parts.names);
        EXPECT_EQ(parts.names, (std::vector<std::string>{"coordIndex", "solid", "texCoordIndex", "point", "title"}));
        ASSERT_EQ(parts.last.as<Array<Vec3f>>().size(), count / 3);
        EXPECT_EQ(parts.last, whole.last);
        // An independent reading of them.
        for (std::size_t i = 0; i < count; ++i) {
            const float expected = std::stof(std::to_string(i % 1000) + "." + std::to_string(i % 7));
            const Vec3f& point = parts.last.as<Array<Vec3f>>()[i / 3];
            ASSERT_EQ(i % 3 == 0 ? point.x : i % 3 == 1 ? point.y : point.z, expected) << i;
        }
    }
}

TEST(Streaming, FaultsInLongListsAreReportedWhereTheyAre) {
    std::string numbers = manyNumbers(60'000, "\n");
    numbers.insert(numbers.size() - 12, " oops ");
    const std::string text = "<X3D version='4.0'><Scene><Shape><PointSet>\n<Coordinate point='" + numbers +
                             "'/></PointSet></Shape><Box bad='1'/></Scene></X3D>";
    const TemporaryFile file("fault.x3d", text);
    const Outcome parts = inBlocks(file.path, 1 << 14);
    EXPECT_THAT(parts.problems, testing::HasSubstr("expected a number (MFVec3f), found 'oops'"));
    EXPECT_THAT(parts.problems, testing::HasSubstr("Box has no field 'bad'"));
    // The line of each: 1 for the start, one more for every number before it.
    const auto lineOf = [&](const char* what) {
        return 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(text.find(what)), '\n');
    };
    EXPECT_THAT(parts.problems, testing::HasSubstr("test:" + std::to_string(lineOf("oops")) + ":"));
    EXPECT_THAT(parts.problems, testing::HasSubstr("test:" + std::to_string(lineOf("<Box")) + ":"));
}

TEST(Streaming, AMalformedEndOfALongListEndsTheReading) {
    for (const std::string& end : {std::string(""), std::string(" < '/></Scene></X3D>")}) {
        const std::string text =
            "<X3D version='4.0'><Scene><Shape><PointSet><Coordinate point='" + manyNumbers(60'000, " ") + end;
        const TemporaryFile file("end.x3d", text);
        const Outcome parts = inBlocks(file.path, 1 << 14);
        EXPECT_FALSE(parts.complete);
        EXPECT_THAT(parts.problems, testing::HasSubstr("not well-formed XML"));
    }
}

/// The most memory that this process has had, in bytes.
std::size_t maxMemory() {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    return static_cast<std::size_t>(usage.ru_maxrss) * 1024;
}

/// The memory for converting a file beyond what the process had before, in a process of its own.
std::size_t memoryOf(const std::string& in, const std::string& out) {
    int ends[2];
    if (::pipe(ends) != 0) return SIZE_MAX;
    const pid_t child = ::fork();
    if (child == 0) {
        const std::size_t before = maxMemory();
        Diagnostics problems(in);
        auto writer = DocumentFileWriter::create(out, problems, Existing::replace);
        const bool good = writer && readDocumentFile(in, (*writer)->handler(), problems) && (*writer)->close();
        const std::size_t used = good ? maxMemory() - before : SIZE_MAX;
        [[maybe_unused]] const ssize_t written = ::write(ends[1], &used, sizeof(used));
        ::_exit(0);
    }
    std::size_t used = SIZE_MAX;
    [[maybe_unused]] const ssize_t got = ::read(ends[0], &used, sizeof(used));
    ::close(ends[0]);
    ::close(ends[1]);
    ::waitpid(child, nullptr, 0);
    return used;
}

constexpr std::size_t kMegabyte = 1 << 20;

// One element of six megabytes, of which the handler hears nothing; the limit of nothing at all passes at once.
TEST(Streaming, ALongTextEndsWhenItsTimeIsOver) {
    std::string text = "<X3D version='4.0' profile='Full'><Scene><Group";
    for (int i = 0; text.size() < (6 << 20); ++i) text += " a" + std::to_string(i) + "='1'";
    text += "/></Scene></X3D>";
    const TemporaryFile file("late", text);
    for (const std::uint64_t seconds : {std::uint64_t{0}, std::uint64_t{3600}}) {
        ResourcePolicy policy;
        policy.maximumSeconds = seconds;
        const Resources resources({}, policy);
        for (const bool isFile : {false, true}) {
            Filter nobody;
            Diagnostics problems("test");
            const ReadOptions options{.resources = &resources};
            const bool complete = isFile ? readDocumentFile(file.path, nobody, problems, options)
                                         : readDocument(text, nobody, problems, options);
            EXPECT_EQ(complete, seconds > 0);
            const std::string said = test::allText(problems);
            EXPECT_EQ(said.find("reading takes more than 0 seconds; the rest is left out, unless --limit seconds=N") !=
                          std::string::npos,
                      seconds == 0)
                << said.substr(0, 300);
            if (seconds == 0) {
                EXPECT_EQ(problems.errors(), 1u);
            }
        }
    }
}

TEST(Streaming, ManyShapesNeedNoMoreMemoryThanAFew) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers have memory of their own";
#endif
    const std::string shape =
        "<Transform translation='1 2 3'><Shape><Appearance><Material diffuseColor='1 .5 .25'/></Appearance>"
        "<Box size='1 2 3'/></Shape></Transform>\n<Shape><PointSet><Coordinate point='" +
        manyNumbers(600, " ") + "'/></PointSet></Shape>\n";
    std::string text = "<X3D version='4.0'><Scene><Group>\n";
    while (text.size() < 50 * kMegabyte) text += shape;
    text += "</Group></Scene></X3D>\n";
    const TemporaryFile in("many.x3d", text);
    text = {};
    for (const char* out : {"out.x3d", "out.x3dv"}) {
        const std::string path = filePath(out);
        EXPECT_LT(memoryOf(in.path, path), 24 * kMegabyte) << out;
        EXPECT_GT(std::filesystem::file_size(path), 25 * kMegabyte);
        // And back from what was written.
        const std::string again = filePath("again.x3dv");
        EXPECT_LT(memoryOf(path, again), 24 * kMegabyte) << out;
        std::filesystem::remove(path);
        std::filesystem::remove(again);
    }
}

TEST(Streaming, OneMeshNeedsItsValueOnce) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers have memory of their own";
#endif
    std::string text = "<X3D version='4.0'><Scene><Shape><PointSet><Coordinate point='";
    std::size_t numbers = 0;
    for (; text.size() < 120 * kMegabyte; numbers += 6) text += "0.125 1.375 2.625 3.75 4.5 5.875\n";
    text += "'/></PointSet></Shape></Scene></X3D>\n";
    const TemporaryFile in("mesh.x3d", text);
    text = {};
    const std::size_t value = numbers * sizeof(float);
    const std::string classic = filePath("out.x3dv");
    EXPECT_LT(memoryOf(in.path, classic), value + 64 * kMegabyte) << "of " << value;
    for (const char* out : {"again.x3dv", "again.x3d", "again.json"}) {
        const std::string again = filePath(out);
        EXPECT_LT(memoryOf(classic, again), value + 64 * kMegabyte) << "of " << value << ", " << out;
        std::filesystem::remove(again);
    }
    std::filesystem::remove(classic);
}

TEST(Streaming, OneNodeOfManySmallOnesIsWrittenWithinTheBound) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers have memory of their own";
#endif
    std::string text = "#X3D V4.0 utf8\nPROFILE Full\nGroup { children [\n";
    while (text.size() < 75 * kMegabyte)
        text += "Transform { translation 1 2 3 children Shape { geometry Box { } } }\n";
    const TemporaryFile in("group.x3dv", text + "] }\n");
    text = {};
    for (const char* out : {"group.x3d", "group.json"}) {
        const std::string path = filePath(out), back = filePath("back.x3dv");
        EXPECT_LT(memoryOf(in.path, path), 64 * kMegabyte) << out;
        EXPECT_LT(memoryOf(path, back), 64 * kMegabyte) << out;
        EXPECT_GT(std::filesystem::file_size(path), 75 * kMegabyte);
        std::filesystem::remove(path);
        std::filesystem::remove(back);
    }
}

TEST(Streaming, JsonNeedsItsLargestValueAlone) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers have memory of their own";
#endif
    const std::string out = filePath("out.x3dv");
    {
        std::string text = R"({"X3D":{"encoding":"UTF-8","@version":"4.0","Scene":{"-children":[)";
        while (text.size() < 50 * kMegabyte)
            text += R"({"Transform":{"@translation":[1,2,3],"-children":[{"Shape":{"-geometry":{"Box":{}}}}]}},)";
        text.back() = ']';
        const TemporaryFile in("many.json", text + "}}}");
        text = {};
        EXPECT_LT(memoryOf(in.path, out), 24 * kMegabyte);
    }
    std::string text = R"({"X3D":{"@version":"4.0","Scene":{"-children":[{"Shape":{"-geometry":{"PointSet":{"-coord":)"
                       R"({"Coordinate":{"@point":[0)";
    std::size_t numbers = 3;
    for (; text.size() < 120 * kMegabyte; numbers += 6) text += ",0.125,1.375,2.625,3.75,4.5,5.875";
    const TemporaryFile in("mesh.json", text + ",1,2]}}}}}}]}}}");
    text = {};
    const std::size_t value = numbers * sizeof(float);
    EXPECT_LT(memoryOf(in.path, out), value + 64 * kMegabyte) << "of " << value;
    std::filesystem::remove(out);
}

}  // namespace
}  // namespace rtsg
