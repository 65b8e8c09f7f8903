// Reports values of a document that have no meaning where they stand, such as unknown words, directions without a
// length and missing layers; each with the value that is used instead.
#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <utility>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>

#include "builder_state.h"

namespace rtsg {

namespace {

using Words = std::span<const std::string_view>;
using std::string_view_literals::operator""sv;

// 18.4.3, tables 18.2 to 18.4.
constexpr std::array kModes{"MODULATE"sv,
                            "REPLACE"sv,
                            "SELECTARG1"sv,
                            "SELECTARG2"sv,
                            "MODULATE2X"sv,
                            "MODULATE4X"sv,
                            "ADD"sv,
                            "ADDSIGNED"sv,
                            "ADDSIGNED2X"sv,
                            "ADDSMOOTH"sv,
                            "SUBTRACT"sv,
                            "BLENDDIFFUSEALPHA"sv,
                            "BLENDTEXTUREALPHA"sv,
                            "BLENDFACTORALPHA"sv,
                            "BLENDCURRENTALPHA"sv,
                            "MODULATEALPHA_ADDCOLOR"sv,
                            "MODULATEINVALPHA_ADDCOLOR"sv,
                            "MODULATEINVCOLOR_ADDALPHA"sv,
                            "OFF"sv,
                            "DOTPRODUCT3"sv,
                            ""sv};
constexpr std::array kSources{"DIFFUSE"sv, "SPECULAR"sv, "FACTOR"sv, ""sv};
constexpr std::array kFunctions{"COMPLEMENT"sv, "ALPHAREPLICATE"sv, ""sv};

constexpr std::int32_t kMaxDrawnPixels = 4096;  // a side of a picture that a scene draws for itself

std::string_view trimmed(std::string_view word) {
    while (!word.empty() && word.front() == ' ') word.remove_prefix(1);
    while (!word.empty() && word.back() == ' ') word.remove_suffix(1);
    return word;
}

/// Collects the reports about a node.
class OddValues {
  public:
    explicit OddValues(const Node& node) : node_(node) {}

    std::vector<std::string> take() { return std::move(found_); }

    /// Checks each text, and both parts of a text that is two words with a comma between them.
    void checkWords(std::string_view field, const Array<String>& texts, Words known, std::string_view instead) {
        for (const String& text : texts) {
            const std::string_view all = text.view();
            const std::size_t comma = all.find(',');
            for (const std::string_view word :
                 {trimmed(all.substr(0, comma)),
                  comma == std::string_view::npos ? std::string_view() : trimmed(all.substr(comma + 1))})
                if (std::ranges::find(known, word) == known.end())
                    say(fmt::format("{}: '{}' is no {} of a MultiTexture: taken as {}", field, word, field, instead));
        }
    }
    void checkDirection(const Vec3f& direction) {
        if (direction == Vec3f(0)) say("direction: 0 0 0 is none: it shines nowhere");
    }
    void checkMaximum(std::string_view field, std::int32_t value, std::int32_t maximum) {
        if (value > maximum) say(fmt::format("{}: {} is more than {}, which is taken", field, value, maximum));
    }
    void checkLayers(const Array<std::int32_t>& order, std::size_t layers) {
        for (const std::int32_t number : order)
            if (number > 0 && static_cast<std::size_t>(number) > layers)
                say(fmt::format("order: there is no layer {}, the last one is {}: it is left out", number, layers));
    }
    void say(std::string what) { found_.push_back(fmt::format("{}.{}", node_.type().name, what)); }

  private:
    const Node& node_;
    std::vector<std::string> found_;
};

void checkTextures(const Node& node, OddValues& odd) {
    if (node.is(x3d::MultiTexture::type)) {
        using M = x3d::MultiTexture;
        odd.checkWords("mode", node.get(M::mode), kModes, "MODULATE");
        odd.checkWords("source", node.get(M::source), kSources, "the texture before");
        odd.checkWords("function", node.get(M::function), kFunctions, "none");
    } else if (node.is(x3d::GeneratedCubeMapTexture::type)) {
        odd.checkMaximum("size", node.get(x3d::GeneratedCubeMapTexture::size), kMaxDrawnPixels);
    } else if (node.is(x3d::RenderedTexture::type)) {
        odd.checkMaximum("width", node.get(x3d::RenderedTexture::width), kMaxDrawnPixels);
        odd.checkMaximum("height", node.get(x3d::RenderedTexture::height), kMaxDrawnPixels);
    } else if (node.is(x3d::ComposedCubeMapTexture::type)) {
        using C = x3d::ComposedCubeMapTexture;
        const auto sides = {C::frontTexture, C::backTexture, C::leftTexture,
                            C::rightTexture, C::topTexture,  C::bottomTexture};
        if (std::ranges::none_of(sides, [&](const auto& side) { return static_cast<bool>(node.get(side)); }))
            odd.say("frontTexture: none of its six sides is given: it shows nothing");
    }
}

void checkLights(const Node& node, OddValues& odd) {
    if (node.is(x3d::DirectionalLight::type)) odd.checkDirection(node.get(x3d::DirectionalLight::direction));
    if (node.is(x3d::SpotLight::type)) odd.checkDirection(node.get(x3d::SpotLight::direction));
    if (node.is(x3d::TextureProjector::type)) odd.checkDirection(node.get(x3d::TextureProjector::direction));
    if (node.is(x3d::TextureProjectorParallel::type))
        odd.checkDirection(node.get(x3d::TextureProjectorParallel::direction));
}

void checkLayering(const Node& node, OddValues& odd) {
    if (node.is(x3d::LayerSet::type)) {
        odd.checkLayers(node.get(x3d::LayerSet::order), node.get(x3d::LayerSet::layers).size());
    } else if (node.is(x3d::Viewport::type)) {
        const Array<float>& clip = node.get(x3d::Viewport::clipBoundary);
        if (clip.size() < 4)
            odd.say(fmt::format("clipBoundary: has {} numbers, not left, right, bottom and top: taken as 0 1 0 1",
                                clip.size()));
        else if (!(clip[0] < clip[1] && clip[2] < clip[3]))
            odd.say("clipBoundary: left is not less than right, or bottom than top: it shows nothing");
    }
}

}  // namespace

void SceneBuilder::State::reportOfOddValues(NodeId id, SourceLocation where) {
    const Node& node = scene.node(id);
    if (isTrial || node.type().kind == NodeType::Kind::proto) return;
    OddValues odd(node);
    checkTextures(node, odd);
    checkLights(node, odd);
    checkLayering(node, odd);
    if (node.is(x3d::LayerSet::type) && std::exchange(hasLayerSet, true))
        odd.say(
            "layers: there is a LayerSet before it, whose order, viewports and activeLayer count: these are drawn with "
            "those of the same numbers");
    if (node.is(x3d::IsoSurfaceVolumeData::type) && node.get(x3d::IsoSurfaceVolumeData::surfaceValues).empty())
        odd.say("surfaceValues: none is given: it shows nothing");
    for (std::string& text : odd.take())
        if (oddValues.emplace(scope().source, where.line, where.column, text).second) warning(where, std::move(text));
}

}  // namespace rtsg
