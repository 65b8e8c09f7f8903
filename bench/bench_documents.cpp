// Reading and writing one mesh in each encoding, against loops of std::from_chars and std::to_chars over the same
// numbers and a copy of the bytes; one long list on two threads; the binary encoding, GLB, STL, PLY and OBJ, and a
// million small nodes.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>
#include <zlib.h>

#include <rtsg/documents/command_list.h>
#include <rtsg/documents/filter.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/writer.h>
#include <rtsg/renderers/mesh_file.h>
#include <rtsg/sync/scene_file.h>

#include "bench.h"

namespace rtsg::bench {

namespace {

struct Encoded {
    const char* name;
    const char* begin;  // of the document, up to the points
    const char* separator;
    const char* middle;  // between points and indices
    const char* end;
};

constexpr Encoded kEncodings[] = {
    {"ClassicVRML",
     "#X3D V4.0 utf8\nPROFILE Interchange\nShape { geometry IndexedTriangleSet { coord Coordinate { point [", " ",
     "] } index [", "] } }\n"},
    {"XML",
     "<?xml version='1.0' encoding='UTF-8'?><X3D version='4.0' profile='Interchange'><Scene><Shape><IndexedTriangleSet "
     "index='",
     " ", "'><Coordinate point='", "'/></IndexedTriangleSet></Shape></Scene></X3D>\n"},
    {"JSON",
     R"({"X3D":{"@version":"4.0","@profile":"Interchange","Scene":{"-children":[{"Shape":{"-geometry":)"
     R"({"IndexedTriangleSet":{"@index":[)",
     ",", R"(],"-coord":{"Coordinate":{"@point":[)", "]}}}}}}]}}}\n"},
};

std::string points(int n, const char* separator) {
    std::string text;
    for (int z = 0; z <= n; ++z)
        for (int x = 0; x <= n; ++x)
            fmt::format_to(std::back_inserter(text), "{3}{0:.5g}{4}{1:.5g}{4}{2:.5g}", x * .013f,
                           std::sin(x * .1f) * std::cos(z * .07f), z * .013f, text.empty() ? "" : separator, separator);
    return text;
}

std::string indices(int n, const char* separator) {
    std::string text;
    for (int z = 0; z < n; ++z)
        for (int x = 0; x < n; ++x) {
            const int a = z * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
            fmt::format_to(std::back_inserter(text), "{6}{0}{7}{1}{7}{2}{7}{3}{7}{4}{7}{5}", a, c, b, b, c, d,
                           text.empty() ? "" : separator, separator);
        }
    return text;
}

std::string document(const Encoded& encoding, int n) {
    const bool pointsFirst = std::strstr(encoding.begin, "point") != nullptr;
    std::string text = encoding.begin;
    text += pointsFirst ? points(n, encoding.separator) : indices(n, encoding.separator);
    text += encoding.middle;
    text += pointsFirst ? indices(n, encoding.separator) : points(n, encoding.separator);
    return text + encoding.end;
}

/// Keeps what it is given, as a scene would.
struct Keeper final : Filter {
    std::vector<Value> values;
    void setField(std::string_view, Value value, SourceLocation) override { values.push_back(std::move(value)); }
};

double toCharsSeconds(const std::vector<Value>& values) {
    const double start = cpuSeconds();
    char text[64];
    std::size_t bytes = 0;
    for (const Value& value : values) {
        if (value.holds<Array<Vec3f>>())
            for (const Vec3f& v : value.as<Array<Vec3f>>())
                for (int i = 0; i < 3; ++i)
                    bytes += static_cast<std::size_t>(std::to_chars(text, text + sizeof(text), v[i]).ptr - text);
        if (value.holds<Array<std::int32_t>>())
            for (const std::int32_t v : value.as<Array<std::int32_t>>())
                bytes += static_cast<std::size_t>(std::to_chars(text, text + sizeof(text), v).ptr - text);
    }
    keep(bytes);
    return cpuSeconds() - start;
}

double copySeconds(std::size_t size, const char* from) {
    const double start = cpuSeconds();
    std::string same(size, '\0');
    std::memcpy(same.data(), from, size);
    keep(same.data());
    return cpuSeconds() - start;
}

void writing(const Report& report, int n) {
    constexpr std::pair<Encoding, const char*> encodings[] = {{Encoding::classicVrml, "ClassicVRML"},
                                                              {Encoding::vrml97, "VRML97"},
                                                              {Encoding::xml, "XML"},
                                                              {Encoding::json, "JSON"}};
    const std::string text = document(kEncodings[0], n);
    CommandList commands;
    Keeper keeper;
    Diagnostics diagnostics;
    readDocument(text, commands, diagnostics);
    readDocument(text, keeper, diagnostics);
    for (const auto& [encoding, name] : encodings) {
        std::vector<double> ours, naive, copy;
        std::size_t bytes = 0;
        for (int i = 0; i < 3; ++i) {
            bytes = 0;
            const double start = cpuSeconds();
            const auto writer =
                makeWriter(encoding, [&](std::string_view piece) { bytes += piece.size(); }, diagnostics);
            commands.replay(*writer);
            ours.push_back(cpuSeconds() - start);
            naive.push_back(toCharsSeconds(keeper.values));
            copy.push_back(copySeconds(text.size(), text.data()));
        }
        const double megabytes = static_cast<double>(bytes) / 1e6;
        report({"documents", fmt::format("{} triangles, {}", 2 * n * n, name), "text written", "MB/s",
                megabytes / median(ours), "std::to_chars of the numbers", megabytes / median(naive),
                "memcpy of the text", static_cast<double>(text.size()) / 1e6 / median(copy)});
    }
}

/// A name in the folder of temporary files, gone with the object.
struct TemporaryFile {
    std::filesystem::path path;
    explicit TemporaryFile(const char* extension)
        : path(std::filesystem::temp_directory_path() / fmt::format("rtsg-bench-{}{}", ::getpid(), extension)) {}
    ~TemporaryFile() {
        std::error_code ignored;
        std::filesystem::remove(path, ignored);
    }
};

std::string contentOf(const std::filesystem::path& file) {
    std::string bytes(std::filesystem::file_size(file), '\0');
    std::ifstream(file, std::ios::binary).read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return bytes;
}

std::size_t gzipSize(const std::string& text) {
    std::string packed(compressBound(static_cast<uLong>(text.size())), '\0');
    auto size = static_cast<uLongf>(packed.size());
    keep(compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(text.data()),
                   static_cast<uLong>(text.size()), 6));
    return size;
}

/// A mesh, as this document has it.
void loadMesh(Scene& scene, const std::string& text) {
    Diagnostics diagnostics;
    if (!loadText(scene, text, diagnostics)) throw std::logic_error("the bench's document is not read");
    scene.newFrame(0);
}

void ownBinary(const Report& report, int n) {
    const std::string text = document(kEncodings[0], n);
    Scene scene;
    loadMesh(scene, text);
    const TemporaryFile file(".rtsgb");
    const double arrays = 12.0 * (n + 1) * (n + 1) + 4.0 * 6 * n * n;  // bytes of points and indices
    const std::string plain(static_cast<std::size_t>(arrays), '\1');
    std::vector<double> written, read, bare, opened;
    for (int i = 0; i < 3; ++i) {
        double start = cpuSeconds();
        if (!writeSceneFile(scene, file.path)) throw std::logic_error("the bench's binary file is not written");
        written.push_back(cpuSeconds() - start);
        start = cpuSeconds();
        Scene again;
        if (!readSceneFile(again, file.path)) throw std::logic_error("the bench's binary file is not read");
        read.push_back(cpuSeconds() - start);
        bare.push_back(copySeconds(plain.size(), plain.data()));
        start = cpuSeconds();
        const std::string bytes = contentOf(file.path);
        keep(bytes.data());
        opened.push_back(cpuSeconds() - start);
    }
    const std::string what = fmt::format("{} triangles, rtsgb", 2 * n * n);
    const double size = static_cast<double>(std::filesystem::file_size(file.path)) / 1e6;
    report({"documents", what, "arrays read", "MB/s", arrays / 1e6 / median(read), "memcpy of the arrays",
            arrays / 1e6 / median(bare), "the file's bytes, packed", size / median(opened)});
    report({"documents", what, "arrays written", "MB/s", arrays / 1e6 / median(written), "memcpy of the arrays",
            arrays / 1e6 / median(bare), "", 0});
    report({"documents", what, "size", "MB", size, "gzip of the text", static_cast<double>(gzipSize(text)) / 1e6,
            "the arrays", arrays / 1e6});
}

/// Files of other programs, each beside what reads its numbers and nothing else.
void otherBinaries(const Report& report, int n) {
    struct Kind {
        const char *name, *extension;
        MeshFormat format;
        bool isText;
    };
    constexpr Kind kKinds[] = {{"GLB", ".glb", MeshFormat::glb, false},
                               {"STL", ".stl", MeshFormat::stl, false},
                               {"PLY", ".ply", MeshFormat::ply, false},
                               {"OBJ", ".obj", MeshFormat::obj, true}};
    Scene scene;
    loadMesh(scene, document(kEncodings[0], n));
    for (const Kind& kind : kKinds) {
        const TemporaryFile file(kind.extension);
        Diagnostics diagnostics;
        if (!writeMeshFile(scene, file.path, kind.format, diagnostics))
            throw std::logic_error("the bench's mesh is not written");
        std::vector<double> imported, bare, opened;
        for (int i = 0; i < 3; ++i) {
            double start = cpuSeconds();
            Keeper keeper;
            if (!readDocumentFile(file.path, keeper, diagnostics) || keeper.values.empty())
                throw std::logic_error("the bench's mesh is not read");
            imported.push_back(cpuSeconds() - start);
            start = cpuSeconds();
            const std::string bytes = contentOf(file.path);
            keep(bytes.data());
            opened.push_back(cpuSeconds() - start);
            bare.push_back(kind.isText ? fromCharsSeconds(bytes) : copySeconds(bytes.size(), bytes.data()));
        }
        const double size = static_cast<double>(std::filesystem::file_size(file.path)) / 1e6;
        report({"documents", fmt::format("{} triangles, {}", 2 * n * n, kind.name), "file read", "MB/s",
                size / median(imported), kind.isText ? "std::from_chars over the numbers" : "memcpy of the bytes",
                size / median(bare), "the file's bytes", size / median(opened)});
    }
}

void smallNodes(const Report& report, int count) {
    std::string text = "#X3D V4.0 utf8\nPROFILE Interchange\n";
    for (int i = 0; i < count; ++i) fmt::format_to(std::back_inserter(text), "Transform {{ translation {} 0 1 }}\n", i);
    std::vector<double> read, built, copied;
    for (int i = 0; i < 3; ++i) {
        Diagnostics diagnostics;
        double start = cpuSeconds();
        CountFilter counted;
        readDocument(text, counted, diagnostics);
        read.push_back(cpuSeconds() - start);
        start = cpuSeconds();
        Scene scene;
        loadText(scene, text, diagnostics);
        built.push_back(cpuSeconds() - start);
        copied.push_back(copySeconds(text.size(), text.data()));
    }
    const std::string what = fmt::format("{} small nodes", count);
    report({"documents", what, "nodes read", "1/s", count / median(read), "", 0, "memcpy of the text",
            count / median(copied)});
    report({"documents", what, "nodes read into a scene", "1/s", count / median(built), "", 0, "memcpy of the text",
            count / median(copied)});
}

/// Wall time of one reading; what it gives goes afterwards.
double readingSeconds(const std::string& text, unsigned threads) {
    Keeper keeper;
    Diagnostics diagnostics;
    const double start = wallSeconds();
    const bool good = readDocument(text, keeper, diagnostics, {.threads = threads});
    const double seconds = wallSeconds() - start;
    if (!good || !diagnostics.all().empty()) throw std::logic_error("the long list of the bench is not read");
    return seconds;
}

/// The fastest of some runs of each, since others on the machine only ever take time away; beside two threads that read
/// one document each.
void oneList(const Report& report, const Encoded& encoding, int n) {
    const std::string numbers = points(n, encoding.separator);
    const bool pointsFirst = std::strstr(encoding.begin, "point") != nullptr;
    const std::string text =
        encoding.begin + (pointsFirst ? numbers : "0") + encoding.middle + (pointsFirst ? "0" : numbers) + encoding.end;
    double one = 1e9, two = 1e9, both = 1e9;
    for (int i = 0; i < 9; ++i) {
        one = std::min(one, readingSeconds(text, 1));
        two = std::min(two, readingSeconds(text, 2));
        const double start = wallSeconds();
        {
            const std::jthread other([&] { readingSeconds(text, 1); });
            readingSeconds(text, 1);
        }
        both = std::min(both, wallSeconds() - start);
    }
    const double megabytes = static_cast<double>(text.size()) / 1e6;
    const std::string what = fmt::format("{:.1f} MB of points in one field, {}", megabytes, encoding.name);
    report({"documents", what, "one field on two threads, wall time", "MB/s", megabytes / two, "one thread",
            megabytes / one, "a document each for two threads", 2 * megabytes / both});
    report({"documents", what, "one field on two threads", "times as fast as one", one / two, "one thread", 1,
            "a document each for two threads", 2 * one / both});
}

}  // namespace

void documents(const Report& report, bool quick) {
    const int n = quick ? 100 : 800;
    for (const Encoded& encoding : kEncodings) {
        const std::string text = document(encoding, n);
        const double megabytes = static_cast<double>(text.size()) / 1e6;
        std::vector<double> ours, naive, copy;
        for (int i = 0; i < 5; ++i) {
            double start = cpuSeconds();
            Keeper keeper;
            Diagnostics diagnostics;
            if (!readDocument(text, keeper, diagnostics, {.threads = 1}) || !diagnostics.all().empty())
                throw std::logic_error("the document of the bench is not read");
            ours.push_back(cpuSeconds() - start);
            naive.push_back(fromCharsSeconds(text));
            start = cpuSeconds();
            std::string same(text.size(), '\0');
            std::memcpy(same.data(), text.data(), text.size());
            keep(same.data());
            copy.push_back(cpuSeconds() - start);
        }
        report({"documents", fmt::format("{} triangles, {}", 2 * n * n, encoding.name), "text read", "MB/s",
                megabytes / median(ours), "std::from_chars over the numbers", megabytes / median(naive),
                "memcpy of the text", megabytes / median(copy)});
    }
    for (const Encoded& encoding : kEncodings) oneList(report, encoding, quick ? 500 : 1200);
    writing(report, n);
    const int million = quick ? 100 : 707;  // triangles
    ownBinary(report, million);
    otherBinaries(report, million);
    smallNodes(report, quick ? 10'000 : 1'000'000);
}

}  // namespace rtsg::bench
