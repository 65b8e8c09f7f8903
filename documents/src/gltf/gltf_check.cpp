// Goes through the JSON of a glTF file along a table of what its objects have.
#include "gltf_check.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/never_destroyed.h>

namespace rtsg::detail {

using nlohmann::json;

namespace {

enum class Is : std::uint8_t {
    index,       // the number of one of the list `what`
    indices,     // several
    attributes,  // an object of numbers of accessors
    count,       // a number from 0 on
    size,        // a number from 1 on
    number,
    amount,    // a number from 0 on
    positive,  // a number above 0
    fraction,  // a number from 0 to 1
    numbers,   // as many as `what` says; any, if it says nothing
    flag,
    text,
    texts,   // a list of them
    word,    // one of those in `what`, which ends each by a blank
    code,    // the same, of whole numbers
    object,  // of the shape `what`
    list,    // of objects of the shape `what`
};
struct Member {
    std::string_view of, key;  // the shape that has it
    Is is;
    std::string_view what{};
    bool isRequired = false;
};

/// Members of shapes; the shape of the whole is "file".
constexpr Member kMembers[] = {
    {"file", "scene", Is::index, "scenes"},
    {"file", "scenes", Is::list, "scene"},
    {"file", "nodes", Is::list, "node"},
    {"file", "meshes", Is::list, "mesh"},
    {"file", "accessors", Is::list, "accessor"},
    {"file", "bufferViews", Is::list, "view"},
    {"file", "buffers", Is::list, "buffer"},
    {"file", "materials", Is::list, "material"},
    {"file", "textures", Is::list, "texture"},
    {"file", "images", Is::list, "image"},
    {"file", "samplers", Is::list, "texture sampler"},
    {"file", "cameras", Is::list, "camera"},
    {"file", "skins", Is::list, "skin"},
    {"file", "animations", Is::list, "animation"},
    {"file", "extensions", Is::object, "file's extensions"},
    {"file", "extensionsUsed", Is::texts},
    {"file", "extensionsRequired", Is::texts},
    {"file's extensions", "KHR_lights_punctual", Is::object, "lights"},
    {"file's extensions", "KHR_materials_variants", Is::object, "variants"},
    {"lights", "lights", Is::list, "light"},
    {"variants", "variants", Is::list, "variant"},
    {"variant", "name", Is::text},
    {"scene", "nodes", Is::indices, "nodes"},
    {"node", "name", Is::text},
    {"node", "children", Is::indices, "nodes"},
    {"node", "mesh", Is::index, "meshes"},
    {"node", "camera", Is::index, "cameras"},
    {"node", "skin", Is::index, "skins"},
    {"node", "matrix", Is::numbers, "16"},
    {"node", "rotation", Is::numbers, "4"},
    {"node", "scale", Is::numbers, "3"},
    {"node", "translation", Is::numbers, "3"},
    {"node", "weights", Is::numbers},
    {"node", "extensions", Is::object, "node's extensions"},
    {"node's extensions", "KHR_lights_punctual", Is::object, "node's light"},
    {"node's extensions", "EXT_mesh_gpu_instancing", Is::object, "instances"},
    {"node's light", "light", Is::index, "lights", true},
    {"instances", "attributes", Is::attributes, {}, true},
    {"mesh", "name", Is::text},
    {"mesh", "primitives", Is::list, "primitive", true},
    {"mesh", "weights", Is::numbers},
    {"primitive", "attributes", Is::attributes, {}, true},
    {"primitive", "indices", Is::index, "accessors"},
    {"primitive", "material", Is::index, "materials"},
    {"primitive", "mode", Is::code, "0 1 2 3 4 5 6 "},
    {"primitive", "targets", Is::list, "target"},
    {"primitive", "extensions", Is::object, "primitive's extensions"},
    {"primitive's extensions", "KHR_materials_variants", Is::object, "primitive's variants"},
    {"primitive's extensions", "KHR_draco_mesh_compression", Is::object, "packed primitive"},
    {"packed primitive", "bufferView", Is::index, "bufferViews", true},
    {"primitive's variants", "mappings", Is::list, "mapping", true},
    {"mapping", "material", Is::index, "materials", true},
    {"mapping", "variants", Is::indices, "variants", true},
    {"target", "POSITION", Is::index, "accessors"},
    {"target", "NORMAL", Is::index, "accessors"},
    {"target", "TANGENT", Is::index, "accessors"},
    {"accessor", "bufferView", Is::index, "bufferViews"},
    {"accessor", "byteOffset", Is::count},
    {"accessor", "componentType", Is::code, "5120 5121 5122 5123 5125 5126 ", true},
    {"accessor", "count", Is::size, {}, true},
    {"accessor", "type", Is::word, "SCALAR VEC2 VEC3 VEC4 MAT2 MAT3 MAT4 ", true},
    {"accessor", "normalized", Is::flag},
    {"accessor", "sparse", Is::object, "sparse"},
    {"sparse", "count", Is::size, {}, true},
    {"sparse", "indices", Is::object, "sparse indices", true},
    {"sparse", "values", Is::object, "sparse values", true},
    {"sparse indices", "bufferView", Is::index, "bufferViews", true},
    {"sparse indices", "byteOffset", Is::count},
    {"sparse indices", "componentType", Is::code, "5121 5123 5125 ", true},
    {"sparse values", "bufferView", Is::index, "bufferViews", true},
    {"sparse values", "byteOffset", Is::count},
    {"view", "buffer", Is::index, "buffers", true},
    {"view", "byteOffset", Is::count},
    {"view", "byteLength", Is::count, {}, true},
    {"view", "byteStride", Is::size},
    {"view", "extensions", Is::object, "view's extensions"},
    {"view's extensions", "EXT_meshopt_compression", Is::object, "packed view"},
    {"view's extensions", "KHR_meshopt_compression", Is::object, "packed view"},
    {"packed view", "buffer", Is::index, "buffers", true},
    {"packed view", "byteOffset", Is::count},
    {"packed view", "byteLength", Is::count, {}, true},
    {"packed view", "byteStride", Is::size, {}, true},
    {"packed view", "count", Is::count, {}, true},
    {"buffer", "uri", Is::text},
    {"buffer", "byteLength", Is::size, {}, true},
    {"material", "name", Is::text},
    {"material", "pbrMetallicRoughness", Is::object, "look"},
    {"material", "normalTexture", Is::object, "lookup"},
    {"material", "occlusionTexture", Is::object, "lookup"},
    {"material", "emissiveTexture", Is::object, "lookup"},
    {"material", "emissiveFactor", Is::numbers, "3"},
    {"material", "alphaMode", Is::word, "OPAQUE MASK BLEND "},
    {"material", "alphaCutoff", Is::amount},
    {"material", "doubleSided", Is::flag},
    {"look", "baseColorFactor", Is::numbers, "4"},
    {"look", "metallicFactor", Is::fraction},
    {"look", "roughnessFactor", Is::fraction},
    {"look", "baseColorTexture", Is::object, "lookup"},
    {"look", "metallicRoughnessTexture", Is::object, "lookup"},
    {"lookup", "index", Is::index, "textures", true},
    {"lookup", "texCoord", Is::count},
    {"lookup", "scale", Is::number},
    {"lookup", "strength", Is::number},
    {"lookup", "extensions", Is::object, "lookup's extensions"},
    {"lookup's extensions", "KHR_texture_transform", Is::object, "texture transform"},
    {"texture transform", "offset", Is::numbers, "2"},
    {"texture transform", "scale", Is::numbers, "2"},
    {"texture transform", "rotation", Is::number},
    {"texture transform", "texCoord", Is::count},
    {"texture", "source", Is::index, "images"},
    {"texture", "sampler", Is::index, "samplers"},
    {"texture", "extensions", Is::object, "texture's extensions"},
    {"texture's extensions", "EXT_texture_webp", Is::object, "texture's source"},
    {"texture's extensions", "KHR_texture_basisu", Is::object, "texture's source"},
    {"texture's source", "source", Is::index, "images"},
    {"image", "uri", Is::text},
    {"image", "mimeType", Is::text},
    {"image", "bufferView", Is::index, "bufferViews"},
    {"texture sampler", "magFilter", Is::code, "9728 9729 "},
    {"texture sampler", "minFilter", Is::code, "9728 9729 9984 9985 9986 9987 "},
    {"texture sampler", "wrapS", Is::code, "10497 33071 33648 "},
    {"texture sampler", "wrapT", Is::code, "10497 33071 33648 "},
    {"camera", "type", Is::word, "perspective orthographic ", true},
    {"camera", "perspective", Is::object, "lens"},
    {"camera", "orthographic", Is::object, "flat lens"},
    {"lens", "yfov", Is::positive, {}, true},
    {"lens", "aspectRatio", Is::positive},
    {"lens", "znear", Is::positive},
    {"lens", "zfar", Is::positive},
    {"flat lens", "xmag", Is::number, {}, true},
    {"flat lens", "ymag", Is::number, {}, true},
    {"flat lens", "znear", Is::number},
    {"flat lens", "zfar", Is::number},
    {"light", "type", Is::word, "directional point spot ", true},
    {"light", "color", Is::numbers, "3"},
    {"light", "intensity", Is::amount},
    {"light", "range", Is::positive},
    {"light", "spot", Is::object, "cone"},
    {"cone", "innerConeAngle", Is::number},
    {"cone", "outerConeAngle", Is::number},
    {"skin", "joints", Is::indices, "nodes", true},
    {"skin", "inverseBindMatrices", Is::index, "accessors"},
    {"animation", "name", Is::text},
    {"animation", "channels", Is::list, "channel", true},
    {"animation", "samplers", Is::list, "sampler", true},
    {"channel", "sampler", Is::index, "samplers of the animation", true},
    {"channel", "target", Is::object, "channel's target", true},
    {"channel's target", "node", Is::index, "nodes"},
    {"channel's target", "path", Is::text, {}, true},
    {"sampler", "input", Is::index, "accessors", true},
    {"sampler", "output", Is::index, "accessors", true},
    {"sampler", "interpolation", Is::word, "LINEAR STEP CUBICSPLINE "},
};

std::size_t sizeOf(const json& object, const char* key) {
    const auto found = object.is_object() ? object.find(key) : object.end();
    return found != object.end() && found->is_array() ? found->size() : 0;
}

class GltfCheck {
  public:
    GltfCheck(const json& root, Diagnostics& diagnostics) : root_(root), diagnostics_(diagnostics) {}

    void look(const json& object, std::string_view shape) {
        if (shape == "animation") channelSamplers_ = sizeOf(object, "samplers");
        const auto members = std::ranges::equal_range(kSorted, shape, {}, &Member::of);
        for (const Member& member : members) {
            const auto found = object.find(member.key);
            const Step step(*this, member.key);
            if (found != object.end())
                value(*found, member);
            else if (member.isRequired)
                fault("it is missing");
        }
    }

  private:
    /// Goes one step down, and back at the end of its block.
    struct Step {
        Step(GltfCheck& check, std::string_view key) : check_(check), before_(check.path_.size()) {
            check.path_ += '/';
            check.path_ += key;
        }
        Step(GltfCheck& check, std::size_t number) : Step(check, std::string_view(std::to_string(number))) {}
        ~Step() { check_.path_.resize(before_); }
        Step(const Step&) = delete;
        Step& operator=(const Step&) = delete;

      private:
        GltfCheck& check_;
        std::size_t before_;
    };

    void fault(const std::string& what) {
        diagnostics_.error({}, "the glTF file's " + path_.substr(0, 200) + ": " + what);
    }
    void expect(bool good, std::string_view what) {
        if (!good) fault(fmt::format("expected {}", what));
    }
    /// How many there are in a list.
    std::size_t countOf(std::string_view list) const {
        const auto extension = [&](const char* name) -> const json& {
            static const json& kNone = neverDestroyed([] { return json::object(); });
            const auto all = root_.find("extensions");
            if (all == root_.end() || !all->is_object()) return kNone;
            const auto found = all->find(name);
            return found != all->end() ? *found : kNone;
        };
        if (list == "samplers of the animation") return channelSamplers_;
        if (list == "lights") return sizeOf(extension("KHR_lights_punctual"), "lights");
        if (list == "variants") return sizeOf(extension("KHR_materials_variants"), "variants");
        return sizeOf(root_, std::string(list).c_str());
    }
    void index(const json& it, std::string_view list) {
        if (!it.is_number_integer() || (!it.is_number_unsigned() && it.get<std::int64_t>() < 0))
            return fault(fmt::format("expected the number of one of its {}", list));
        if (const auto number = it.get<std::uint64_t>(); number >= countOf(list))
            fault(fmt::format("it names number {} of its {}, which is not there", number, list));
    }
    template <class See>
    void each(const json& all, const See& see) {
        if (!all.is_array()) return fault("expected a list");
        for (std::size_t i = 0; i < all.size(); ++i) {
            const Step step(*this, i);
            see(all[i]);
        }
    }
    void nested(const json& it, std::string_view shape) {
        if (!it.is_object()) return fault("expected an object");
        look(it, shape);
    }
    void attributes(const json& all) {
        if (!all.is_object()) return fault("expected an object");
        for (const auto& [name, number] : all.items()) {
            const Step step(*this, std::string_view(name));
            index(number, "accessors");
        }
    }
    void numbers(const json& it, std::string_view count) {
        const bool good = it.is_array() && (count.empty() || std::to_string(it.size()) == count) &&
                          std::ranges::all_of(it, [](const json& one) { return one.is_number(); });
        expect(good, count.empty() ? "a list of numbers" : fmt::format("{} numbers", count));
    }
    static bool isOneOf(const std::string& word, std::string_view all) {
        return !word.contains(' ') && (" " + std::string(all)).contains(" " + word + " ");
    }
    static bool isCount(const json& it) {
        return it.is_number_integer() && (it.is_number_unsigned() || it.get<std::int64_t>() >= 0);
    }
    void value(const json& it, const Member& member) {
        const double number = it.is_number() ? it.get<double>() : NAN;
        switch (member.is) {
            case Is::index:
                return index(it, member.what);
            case Is::indices:
                return each(it, [&](const json& one) { index(one, member.what); });
            case Is::attributes:
                return attributes(it);
            case Is::count:
                return expect(isCount(it), "a whole number from 0 on");
            case Is::size:
                return expect(isCount(it) && number > 0, "a whole number from 1 on");
            case Is::number:
                return expect(it.is_number(), "a number");
            case Is::amount:
                return expect(number >= 0, "a number from 0 on");
            case Is::positive:
                return expect(number > 0, "a number above 0");
            case Is::fraction:
                return expect(number >= 0 && number <= 1, "a number from 0 to 1");
            case Is::numbers:
                return numbers(it, member.what);
            case Is::flag:
                return expect(it.is_boolean(), "true or false");
            case Is::text:
                return expect(it.is_string(), "a text");
            case Is::texts:
                return expect(it.is_array() && std::ranges::all_of(it, [](const json& one) { return one.is_string(); }),
                              "a list of texts");
            case Is::word:
                return expect(it.is_string() && isOneOf(it.get<std::string>(), member.what),
                              fmt::format("one of {}", member.what.substr(0, member.what.size() - 1)));
            case Is::code:
                return expect(isCount(it) && isOneOf(it.dump(), member.what),
                              fmt::format("one of {}", member.what.substr(0, member.what.size() - 1)));
            case Is::object:
                return nested(it, member.what);
            case Is::list:
                return each(it, [&](const json& one) { nested(one, member.what); });
        }
    }

    static constexpr auto kSorted = [] {
        auto sorted = std::to_array(kMembers);
        std::ranges::sort(sorted, {}, &Member::of);
        return sorted;
    }();
    const json& root_;
    Diagnostics& diagnostics_;
    std::string path_;
    std::size_t channelSamplers_ = 0;
};

}  // namespace

void checkGltf(const json& root, Diagnostics& diagnostics) {
    GltfCheck(root, diagnostics).look(root, "file");
}

}  // namespace rtsg::detail
