// Every node type of X3D is drawn, or named where it is not, or has nothing to draw, which docs/nodes.md says; and in
// all three encodings alike. The scenes are in data/every_type.txt.
#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <rtsg/documents/writer.h>

#include "dds_file.h"
#include "light_scene.h"
#include "support/temp_folder.h"
#include "support/written_font.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using namespace test;

struct TypeScene {
    std::string type, with, without;
    char kind = ':';  // drawn; '!': named; '-': nothing to draw
};

std::string readAll(const std::filesystem::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
}

/// Replaces the names in it by their texts.
std::string spelledOut(std::string text, const std::map<std::string, std::string>& names) {
    for (std::size_t at = text.find('$'); at != text.npos; at = text.find('$', at)) {
        std::size_t end = at + 1;
        while (end < text.size() && ((text[end] >= 'A' && text[end] <= 'Z') || (text[end] >= '0' && text[end] <= '9')))
            ++end;
        text.replace(at, end - at, names.at(text.substr(at + 1, end - at - 1)));
    }
    return text;
}

/// Splits what is in [[ ]].
TypeScene splitScene(std::string type, char kind, const std::string& body) {
    TypeScene scene{std::move(type), {}, {}, kind};
    std::size_t at = 0;
    for (std::size_t open = body.find("[["); open != body.npos; open = body.find("[[", at)) {
        const std::size_t close = body.find("]]", open);
        const std::string inner = body.substr(open + 2, close - open - 2);
        const std::size_t bar = inner.find("||");
        const std::string before = body.substr(at, open - at);
        scene.with += before + inner.substr(0, bar);
        scene.without += before + (bar == inner.npos ? "" : inner.substr(bar + 2));
        at = close + 2;
    }
    scene.with += body.substr(at), scene.without += body.substr(at);
    return scene;
}

std::vector<TypeScene> typeScenes() {
    std::istringstream text(readAll(RTSG_SOURCE_DIR "/tests/renderers/light/data/every_type.txt"));
    std::vector<std::string> lines;
    for (std::string line; std::getline(text, line);) {
        if (line.empty() || line[0] == '#') continue;
        if (line[0] == ' ')
            lines.back() += line.substr(1);
        else
            lines.push_back(line);
    }
    std::map<std::string, std::string> names;
    std::vector<TypeScene> scenes;
    for (const std::string& line : lines) {
        std::istringstream words(line);
        std::string first, second;
        words >> first;
        if (first == "let") {
            words >> second;
            names[second] = spelledOut(line.substr(5 + second.size()), names);
            continue;
        }
        const bool drawn = first.ends_with(':');
        if (drawn)
            first.pop_back();
        else
            words >> second;
        const auto from = static_cast<std::size_t>(words.tellg());
        scenes.push_back(splitScene(first, drawn ? ':' : second[0], spelledOut(line.substr(from), names)));
    }
    return scenes;
}

/// Whether a text contains a name as a word.
bool standsIn(const std::string& text, const std::string& name) {
    const auto isPart = [&](std::size_t i) {
        return i < text.size() && (std::isalnum(static_cast<unsigned char>(text[i])) || text[i] == '_');
    };
    for (std::size_t at = text.find(name); at != text.npos; at = text.find(name, at + 1))
        if (!isPart(at - 1) && !isPart(at + name.size())) return true;
    return false;
}

class EveryType : public testing::Test {
  protected:
    static constexpr int kSide = 24;

    EveryType() {
        const auto write = [&](const char* name, const std::string& bytes) {
            std::ofstream(folder_ / name, std::ios::binary) << bytes;
        };
        std::string cross = "P5\n8 6\n255\n";
        for (int i = 0; i < 48; ++i) cross += static_cast<char>(5 * i);
        write("cross.pgm", cross);
        std::vector<std::uint32_t> pixels;
        for (std::uint32_t i = 0; i < 64; ++i) pixels.push_back(0xFF000000u | (3 * i) * 0x010101u);
        write("block.dds", dds(4, false, 4, pixels));
        write("boxes.ttf", WrittenFont().bytes());
        write("ball.x3dv", "#X3D V4.1 utf8\nPROFILE Full\nShape { geometry Sphere { } }\n");
        std::filesystem::copy(RTSG_SOURCE_DIR "/tests/renderers/light/data/film.mp4", folder_.path());
    }
    static std::string document(const std::string& body) {
        const bool eye = body.find("Viewpoint") != body.npos;
        return "#X3D V4.1 utf8\nPROFILE Full\n" + std::string(eye ? "" : "Viewpoint { }\n") + body + "\n";
    }
    /// Draws it a second after it was loaded; the reports are in said_.
    Picture draw(const std::string& text) {
        Scene scene;
        said_ = Diagnostics();
        const Resources resources = Resources::ofFile(folder_.path() / "main.x3dv");
        LoadOptions load;
        load.resources = resources;
        EXPECT_TRUE(loadText(scene, text, said_, folder_.path(), load)) << text;
        SharedWorld world(scene);
        LightRenderer light(world, LightRenderer::Options(resources));
        scene.newFrame(0);
        scene.newFrame(1);
        ImageOptions options;
        options.settings.width = options.settings.height = kSide;
        const auto picture = light.picture(options);
        said_.append(light.diagnostics());
        if (!picture) ADD_FAILURE() << picture.error().format() << "\n" << text;
        return picture ? *picture : Picture(kSide, kSide);
    }
    std::string said() const {
        std::string all;
        for (const Diagnostic& d : said_.all()) all += d.format() + "\n";
        return all;
    }
    static std::string rewritten(const std::string& text, Encoding encoding) {
        std::string out;
        Diagnostics ignored;
        readDocument(text, *makeWriter(encoding, [&](std::string_view piece) { out += piece; }, ignored), ignored);
        EXPECT_TRUE(ignored.all().empty()) << ignored.all()[0].format();
        return out;
    }
    /// The greatest difference of two pixels, of 1.
    static float difference(const Picture& a, const Picture& b) {
        float maximum = 0;
        for (std::size_t i = 0; i < a.pixels.size(); ++i)
            for (int c = 0; c < 4; ++c) maximum = std::max(maximum, std::abs(a.pixels[i][c] - b.pixels[i][c]));
        return maximum;
    }

    const TempFolder folder_;
    Diagnostics said_;
};

TEST_F(EveryType, IsInTheList) {
    std::set<std::string> listed, there;
    for (const TypeScene& scene : typeScenes()) {
        EXPECT_TRUE(listed.insert(scene.type).second) << scene.type << " stands there twice";
        EXPECT_TRUE(standsIn(scene.with, scene.type)) << scene.type << ": " << scene.with;
    }
    for (const auto& type : builtinTypes())
        if (!type->internal && type->kind == NodeType::Kind::builtin) there.insert(std::string(type->name));
    EXPECT_GE(there.size(), 259u);
    EXPECT_EQ(listed, there);
}

TEST_F(EveryType, IsDrawnOrNamedOrHasNothingToDraw) {
    const std::string page = readAll(RTSG_SOURCE_DIR "/docs/nodes.md");
    for (const TypeScene& scene : typeScenes()) {
        SCOPED_TRACE(scene.type);
        const Picture without = draw(document(scene.without));
        const std::string saidWithout = said();
        const Picture with = draw(document(scene.with));
        const float changed = difference(with, without);
        if (scene.kind == ':') {
            EXPECT_GT(changed, .02f) << document(scene.with) << said();
            EXPECT_EQ(said(), "");
            continue;
        }
        EXPECT_EQ(changed, 0);
        if (scene.kind == '-') {
            EXPECT_EQ(said(), saidWithout);
            EXPECT_TRUE(standsIn(page, scene.type)) << "docs/nodes.md does not say so";
            continue;
        }
        const auto isNamed = [&](const Diagnostic& d) {
            return d.text.find(scene.type) != d.text.npos && d.where.line > 0;
        };
        EXPECT_EQ(std::ranges::count_if(said_.all(), isNamed), 1) << said();
    }
}

TEST_F(EveryType, IsTheSameInXmlAndJson) {
    for (const TypeScene& scene : typeScenes()) {
        SCOPED_TRACE(scene.type);
        const std::string text = document(scene.with);
        const Picture classic = draw(text);
        for (const Encoding encoding : {Encoding::xml, Encoding::json}) {
            const std::string again = rewritten(text, encoding);
            EXPECT_EQ(draw(again).pixels, classic.pixels) << again;
        }
    }
}

TEST_F(EveryType, StandsBesideAllOthersInOneScene) {
    std::string body;
    int number = 0;
    for (const TypeScene& scene : typeScenes()) {
        // Each a little further off, or the first would hide all others. A scene has one LayerSet.
        if (scene.with.find("LayerSet") != scene.with.npos) continue;
        body += fmt::format("Transform {{ translation {} {} 0 scale .1 .1 .1 children [ {} ] }}\n", number % 16 - 8,
                            number / 16 - 8, scene.with);
        ++number;
    }
    body +=
        "LayerSet { order [ 0 1 2 ] layers [ Layer { viewport Viewport { clipBoundary [ 0 .1 0 .1 ] } children Shape { "
        "geometry Box { } } } LayoutLayer { layout Layout { } children LayoutGroup { children ScreenGroup { } } } ] }";
    const std::string text = document(body);
    const Picture classic = draw(text);
    EXPECT_GT(difference(classic, draw(document(""))), .02f);
    for (const Encoding encoding : {Encoding::xml, Encoding::json})
        EXPECT_EQ(draw(rewritten(text, encoding)).pixels, classic.pixels);
}

}  // namespace
}  // namespace rtsg
