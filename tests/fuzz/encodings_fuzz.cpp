// One random scene through every encoding, text and binary, has one hash. The bytes are the choices of a generator, so
// that libFuzzer's changes are changes of the scene.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_exporter.h>
#include <rtsg/documents/writer.h>
#include <rtsg/sync/scene_file.h>

namespace {

using namespace rtsg;

/// A ClassicVRML document of what the bytes say; when they are at an end, it ends.
class Generator {
  public:
    Generator(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}

    std::string document() {
        std::string text = "#X3D V4.0 utf8\nPROFILE Full\nMETA \"a\" \"b < & \\\" c\"\n";
        if (next() % 2)
            text +=
                "PROTO P [ inputOutput SFVec3f at 1 2 3 initializeOnly MFNode kids [ ] ] { Transform { translation IS "
                "at "
                "children IS kids } }\n";
        else
            text +=
                "PROTO P [ inputOutput SFVec3f at 0 0 0 initializeOnly MFNode kids [ DEF K Group { } ] ] { Group { "
                "children IS kids } }\n";
        while (at_ < size_ && text.size() < 20'000) text += node(0);
        for (std::size_t i = 1; i < transforms_.size(); ++i)
            if (next() % 2)
                text += fmt::format("ROUTE {}.translation TO {}.center\n", transforms_[i - 1], transforms_[i]);
        return text;
    }

  private:
    unsigned next() { return at_ < size_ ? data_[at_++] : 0; }
    std::string number() {
        const std::uint32_t bits = next() | next() << 8 | next() << 16 | (next() % 128) << 24;
        float value = 0;
        std::memcpy(&value, &bits, sizeof(value));
        return std::isfinite(value) ? fmt::format("{}", value) : "0.5";
    }
    std::string vec() { return number() + " " + number() + " " + number(); }
    std::string text() {
        std::string result = "\"";
        for (unsigned n = next() % 6; n > 0; --n) {
            constexpr const char* pieces[] = {"a",        " ",  "\\\"", "\\\\", "<", "&", "'",
                                              "\xC3\xA4", "\n", "]]>",  "--",   "{", ","};
            result += pieces[next() % std::size(pieces)];
        }
        return result + "\"";
    }
    std::string name() {
        constexpr const char* odd[] = {"N", "a-b", "_x", "_x002E_", "\xC3\xB6", "$", "a:b", "n<"};
        return fmt::format("{}{}", odd[next() % std::size(odd)], ++count_);
    }
    std::string node(int depth) {
        const std::string own = name();
        std::string result = "DEF " + own + " ";
        switch (next() % (depth < 6 ? 8 : 5)) {
            case 0:
                return done_.empty() || depth == 0 ? "Group { }\n" : "USE " + done_[next() % done_.size()] + "\n";
            case 1:
                result +=
                    "Shape { appearance Appearance { material Material { diffuseColor .1 .2 .3 shininess .25 } } "
                    "geometry "
                    "IndexedFaceSet { coordIndex [ 0 1 2 -1 ] coord Coordinate { point [ " +
                    vec() + ", " + vec() + ", " + vec() + " ] } } }\n";
                break;
            case 2:
                result += "Script { inputOutput SFVec3f v " + vec() + " initializeOnly MFString s [ " + text() + " " +
                          text() + " ] outputOnly SFTime t initializeOnly SFNode me USE " + own + " }\n";
                break;
            case 3:
                result += "WorldInfo { title " + text() + " info [ " + text() + ", " + text() + " ] }\n";
                break;
            case 4:
                result += "P { at " + vec() + (next() % 2 ? " kids [ Shape { } ]" : "") + " }\n";
                break;
            default: {
                result += "Transform { translation " + vec() + " visible " + (next() % 2 ? "TRUE" : "FALSE") +
                          " children [\n";
                for (unsigned n = next() % 4; n > 0 && at_ < size_; --n) result += node(depth + 1);
                result += "] }\n";
                transforms_.push_back(own);
                break;
            }
        }
        done_.push_back(own);
        return result;
    }

    const std::uint8_t* data_;
    std::size_t size_, at_ = 0;
    int count_ = 0;
    std::vector<std::string> done_, transforms_;
};

void require(bool holds, const char* what, const std::string& text) {
    if (holds) return;
    std::fprintf(stderr, "VIOLATED: %s\n----\n%s\n", what, text.c_str());
    std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    const std::string text = Generator(data, size).document();
    Scene scene;
    Diagnostics diagnostics;
    require(loadText(scene, text, diagnostics) && diagnostics.errors() == 0, "the generator's document is good", text);
    scene.seal();
    for (const Encoding encoding : {Encoding::xml, Encoding::json, Encoding::classicVrml}) {
        std::string written;
        Diagnostics problems;
        const auto writer = makeWriter(encoding, [&](std::string_view piece) { written += piece; }, problems);
        SceneExporter(scene, problems).write(*writer, encoding);
        Scene again;
        loadText(again, written, problems);
        again.seal();
        require(problems.errors() == 0, "it is read back without an error", written);
        require(again.hash() == scene.hash(), "it is the same scene", text + "--------\n" + written);
    }
    const auto file = std::filesystem::temp_directory_path() / fmt::format("rtsg-encodings-{}.rtsgb", ::getpid());
    Scene binary;
    require(writeSceneFile(scene, file) && readSceneFile(binary, file), "the binary encoding is read back", text);
    require(binary.hash() == scene.hash(), "the binary encoding is the same scene", text);
    std::filesystem::remove(file);
    return 0;
}
