// Reads the containers of glTF: JSON, GLB chunks, buffers in data: urls and beside the file, accessors.
#include "gltf_file.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>

#include <rtsg/core/machine.h>
#include <rtsg/core/portable_math.h>
#include <rtsg/core/web_address.h>

#include "gltf_check.h"
#include "gltf_looks.h"
#include "text/text_position.h"

namespace rtsg::detail {

using nlohmann::json;

namespace {

const json kNothing = json::object();
const json kNoList = json::array();
constexpr const char *kDraco = "KHR_draco_mesh_compression", *kMeshopt = "EXT_meshopt_compression",
                     *kMeshoptLater = "KHR_meshopt_compression";

std::size_t componentSize(std::size_t type) {
    constexpr std::size_t kFirst = 5120, kSizes[] = {1, 1, 2, 2, 0, 4, 4};
    return type >= kFirst && type - kFirst < std::size(kSizes) ? kSizes[type - kFirst] : 0;
}

std::size_t componentsOf(std::string_view type) {
    constexpr std::pair<std::string_view, std::size_t> rows[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4},
                                                                 {"MAT2", 4},   {"MAT3", 9}, {"MAT4", 16}};
    for (const auto& [name, count] : rows)
        if (name == type) return count;
    return 0;
}

template <class T>
T at(const char* p) {
    T value;
    std::memcpy(&value, p, sizeof(T));
    return value;
}

double component(const char* p, std::size_t type, bool normalized) {
    switch (type) {
        case 5120:
            return normalized ? std::max(at<std::int8_t>(p) / 127.0, -1.0) : at<std::int8_t>(p);
        case 5121:
            return normalized ? at<std::uint8_t>(p) / 255.0 : at<std::uint8_t>(p);
        case 5122:
            return normalized ? std::max(at<std::int16_t>(p) / 32767.0, -1.0) : at<std::int16_t>(p);
        case 5123:
            return normalized ? at<std::uint16_t>(p) / 65535.0 : at<std::uint16_t>(p);
        case 5125:
            return at<std::uint32_t>(p);
        default:
            return static_cast<double>(at<float>(p));
    }
}

}  // namespace

bool GltfFile::open() {
    std::string_view text = input_.bytes;
    if (text.starts_with("glTF") && !openBinary(text)) return false;
    // Each value takes memory, and there is one before each of these signs at most.
    constexpr std::uint64_t kValue = 100;
    const auto signs = std::ranges::count_if(text, [](char c) { return c == ',' || c == '[' || c == '{'; });
    if (const std::uint64_t bytes = kValue * static_cast<std::uint64_t>(signs); bytes > input_.maximumBytes) {
        diagnostics_.error({}, "the values of the glTF file's JSON take more than " +
                                   std::to_string(input_.maximumBytes) + " bytes; --limit bytes=N raises this");
        return false;
    } else if (auto ok = mayHold(bytes); !ok) {
        diagnostics_.error({}, ok.error().text, ok.error().code);
        return false;
    }
    try {
        root_ = json::parse(text);
    } catch (const json::out_of_range&) {
        diagnostics_.error({}, "a number in the glTF file's JSON is too large");
        return false;
    } catch (const json::parse_error& error) {
        const std::size_t at = std::min(std::max<std::size_t>(error.byte, 1) - 1, text.size());
        // Within a GLB lines mean nothing.
        const SourceLocation where =
            text.data() == input_.bytes.data() ? TextPosition(text.data()).of(text.data() + at) : SourceLocation{};
        diagnostics_.error(where, "the glTF file's JSON is not well-formed, at its byte " + std::to_string(at));
        return false;
    }
    if (!root_.is_object()) {
        diagnostics_.error({1, 1}, "the glTF file's JSON is no object");
        return false;
    }
    const std::string version = GltfFile::text(object(root_, "asset"), "version");
    if (!version.starts_with("2.")) {
        diagnostics_.error({}, version.empty() ? "the glTF file names no version"
                                               : "glTF " + version.substr(0, 20) + " is not read, 2.0 is");
        return false;
    }
    if (const std::string minimum = GltfFile::text(object(root_, "asset"), "minVersion");
        !minimum.empty() && minimum != "2.0") {
        diagnostics_.error({}, "the glTF file needs a reader of glTF " + minimum.substr(0, 20) + "; 2.0 is read");
        return false;
    }
    checkGltf(root_, diagnostics_);
    if (!readExtensions() || !loadModule(text, {kDraco}, dracoModule, draco_) ||
        !loadModule(text, {kMeshopt, kMeshoptLater}, meshoptModule, meshopt_))
        return false;
    findPacked();
    return true;
}

namespace {

constexpr std::string_view kReadExtensions[] = {"KHR_lights_punctual",
                                                "KHR_materials_unlit",
                                                "KHR_mesh_quantization",
                                                "KHR_materials_emissive_strength",
                                                "KHR_texture_basisu",
                                                "KHR_texture_transform",
                                                "EXT_texture_webp",
                                                kDraco,
                                                kMeshopt,
                                                kMeshoptLater,
                                                "KHR_materials_variants",
                                                "EXT_mesh_gpu_instancing"};

/// Whether an extension concerns only looks or metadata, not geometry: without it the scene exists, in other colours.
bool isOfLooks(std::string_view name) {
    return name.contains("_materials_") || name.contains("_technique") || name.contains("_texture_") ||
           name.contains("_lights_") || name.contains("_xmp");
}

}  // namespace

/// 3.12: required extensions must be supported; but those that only concern looks need not prevent the import.
bool GltfFile::readExtensions() {
    const auto isKnown = [](std::string_view name) {
        return std::ranges::find(kReadExtensions, name) != std::end(kReadExtensions) ||
               std::ranges::find(lookExtensions(), name) != lookExtensions().end();
    };
    const std::string required =
        extensions("extensionsRequired", [&](std::string_view name) { return isKnown(name) || isOfLooks(name); });
    if (!required.empty()) {
        diagnostics_.error({}, "the glTF file requires " + required + ", which is not read");
        return false;
    }
    const std::string looks = extensions("extensionsRequired", isKnown);
    if (!looks.empty())
        warn("the glTF file requires " + looks + ", which is not read; it looks otherwise than it should");
    std::set<std::string, std::less<>> reported;
    for (const json& name : list(root_, "extensionsRequired"))
        if (name.is_string()) reported.insert(name.get<std::string>());
    const std::string used =
        extensions("extensionsUsed", [&](std::string_view name) { return isKnown(name) || reported.contains(name); });
    if (!used.empty()) warn("the glTF file uses " + used + ", which is not read; what is there without it is taken");
    return true;
}

bool GltfFile::lists(const char* key, std::string_view extension) const {
    return std::ranges::any_of(
        list(root_, key), [&](const json& name) { return name.is_string() && name.get<std::string>() == extension; });
}

/// Loads what unpacks data, if the file has such, be it listed or not. False if it requires it, and it cannot be had.
template <class Function>
bool GltfFile::loadModule(std::string_view text, std::initializer_list<std::string_view> extensions,
                          Result<Function> (*module)(), Function& into) {
    const auto isIn = [&](const char* key) {
        return std::ranges::any_of(extensions, [&](std::string_view name) { return lists(key, name); });
    };
    const bool isRequired = isIn("extensionsRequired");
    if (!isRequired && std::ranges::none_of(extensions, [&](std::string_view name) { return text.contains(name); }))
        return true;
    if (auto found = module()) {
        into = *found;
        return true;
    } else if (isRequired) {
        diagnostics_.error({}, found.error().text, found.error().code);
        return false;
    } else {
        warn(found.error().text + "; what is there without it is taken");
        return true;
    }
}

/// Those of a list, but for some, with commas between.
std::string GltfFile::extensions(const char* key, const std::function<bool(std::string_view)>& isLeftOut) const {
    constexpr std::size_t maximum = 400;  // bytes of a report
    std::string result;
    for (const json& name : list(root_, key)) {
        const std::string one = name.is_string() ? name.get<std::string>() : std::string();
        if (!isLeftOut(one) && result.size() < maximum) result += (result.empty() ? "" : ", ") + one.substr(0, 80);
    }
    return result;
}

/// 12 bytes of head, then chunks of length, kind and content.
bool GltfFile::openBinary(std::string_view& text) {
    std::string_view all = input_.bytes;
    const auto broken = [&](const std::string& why) {
        diagnostics_.error({}, "the GLB file is damaged: " + why);
        return false;
    };
    if (all.size() < 20) return broken("it is too short");
    if (const auto version = at<std::uint32_t>(all.data() + 4); version != 2) {
        diagnostics_.error({}, "GLB of version " + std::to_string(version) + " is not read, 2 is" +
                                   (version == 1 ? " (version 1 is that of glTF 1.0)" : ""));
        return false;
    }
    const std::size_t length = at<std::uint32_t>(all.data() + 8);
    if (length > all.size())
        return broken("its head counts " + std::to_string(length) + " bytes, and it has " + std::to_string(all.size()));
    if (length < all.size())
        warn("bytes behind the end of the GLB file, which its head counts, are left out: " +
             std::to_string(all.size() - length));
    all = all.substr(0, length);
    text = {};
    for (std::size_t i = 12; i + 8 <= all.size();) {
        const std::size_t size = at<std::uint32_t>(all.data() + i), rest = all.size() - i - 8;
        const auto kind = at<std::uint32_t>(all.data() + i + 4);
        if (size > rest)
            return broken("the chunk at its byte " + std::to_string(i) + " is longer than the rest of the file");
        if (kind == 0x4E4F534A && text.empty()) text = all.substr(i + 8, size);
        if (kind == 0x004E4942 && chunk_.empty()) chunk_ = all.substr(i + 8, size);
        i += 8 + size;
    }
    return !text.empty() || broken("it has no JSON");
}

const json* GltfFile::item(const char* list, std::size_t index) {
    const json& all = GltfFile::list(root_, list);
    return index < all.size() && all[index].is_object() ? &all[index] : nullptr;
}

std::optional<std::size_t> GltfFile::index(const json& object, const char* key) {
    const auto found = object.find(key);
    if (found == object.end() || !found->is_number_integer()) return std::nullopt;
    if (!found->is_number_unsigned() && found->get<std::int64_t>() < 0) return std::nullopt;
    return found->get<std::size_t>();
}

double GltfFile::number(const json& object, const char* key, double otherwise) {
    const auto found = object.find(key);
    return found != object.end() && found->is_number() ? found->get<double>() : otherwise;
}

std::string GltfFile::text(const json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

bool GltfFile::flag(const json& object, const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_boolean() && found->get<bool>();
}

std::optional<std::vector<double>> GltfFile::numbers(const json& object, const char* key, std::size_t count) {
    const json& all = list(object, key);
    if (all.size() != count || !std::ranges::all_of(all, [](const json& one) { return one.is_number(); }))
        return std::nullopt;
    std::vector<double> result;
    for (const json& one : all) result.push_back(one.get<double>());
    return result;
}

const json& GltfFile::object(const json& object, const char* key) {
    const auto found = object.is_object() ? object.find(key) : object.end();
    return found != object.end() && found->is_object() ? *found : kNothing;
}

const json& GltfFile::list(const json& object, const char* key) {
    const auto found = object.is_object() ? object.find(key) : object.end();
    return found != object.end() && found->is_array() ? *found : kNoList;
}

/// Replaces numbers that are not finite by 0, since values computed from them would be meaningless. Numbers that are
/// passed on unchanged are checked by CheckedStream.
void GltfFile::makeFinite(std::vector<float>& numbers) {
    std::size_t changed = 0;
    for (float& number : numbers)
        if (!std::isfinite(number)) number = 0, ++changed;
    if (changed) fault("numbers of the glTF file are not finite; 0 is taken instead");
}

void GltfFile::warn(std::string text) {
    if (reported_.insert(text).second) diagnostics_.warning({}, std::move(text));
}

void GltfFile::fault(std::string text) {
    if (isFull_) return;  // what is left out then has been told
    if (reported_.insert(text).second) diagnostics_.error({}, std::move(text));
}

bool GltfFile::mayMake(std::uint64_t bytes) {
    if (isFull_) return false;
    createdHere_ += std::min(bytes, input_.maximumBytes);
    if (createdHere_ <= input_.maximumBytes) return true;
    isFull_ = true;
    diagnostics_.error({},
                       "what the glTF file describes takes more than " + std::to_string(input_.maximumBytes) +
                           " bytes, as it uses its data again and again; the rest is left out, unless --limit bytes=N "
                           "raises this",
                       DiagnosticCode("memory"));
    return false;
}

std::string_view GltfFile::buffer(std::size_t index) {
    const json* object = item("buffers", index);
    if (!object) return {};
    const std::string uri = text(*object, "uri");
    const auto whole = [&](std::string_view bytes) {
        if (const std::size_t wanted = GltfFile::index(*object, "byteLength").value_or(0); bytes.size() < wanted)
            fault("buffer " + std::to_string(index) + " of the glTF file has " + std::to_string(bytes.size()) +
                  " bytes; its byteLength counts " + std::to_string(wanted));
        return bytes;
    };
    if (uri.empty()) return whole(index == 0 ? chunk_ : std::string_view());
    buffers_.resize(std::max(buffers_.size(), index + 1));
    if (!buffers_[index]) {
        buffers_[index].emplace();
        if (uri.starts_with("data:")) {
            const std::size_t comma = uri.find(";base64,");
            auto bytes = comma == uri.npos ? std::nullopt : base64Decoded(std::string_view(uri).substr(comma + 8));
            if (bytes)
                *buffers_[index] = std::move(*bytes);
            else
                fault("buffer " + std::to_string(index) + " of the glTF file is no base64 text");
        } else {
            auto bytes = input_.open ? input_.open(uri) : fail("no other file may be opened");
            if (bytes)
                *buffers_[index] = std::move(*bytes);
            else
                diagnostics_.error({}, "the buffer " + uri.substr(0, 80) + ": " + bytes.error().text);
        }
        if (!buffers_[index]->empty()) whole(*buffers_[index]);
    }
    return *buffers_[index];
}

std::string_view GltfFile::bufferView(std::size_t index, std::size_t* stride) {
    if (const auto unpacked = unpackedViews_.find(index);
        unpacked != unpackedViews_.end() && index >= list(root_, "bufferViews").size())
        return unpacked->second;
    const json* view = item("bufferViews", index);
    if (!view) return {};
    for (const char* name : {kMeshopt, kMeshoptLater})
        if (const json& packed = extension(*view, name); meshopt_ && !packed.empty()) {
            if (stride) *stride = GltfFile::index(packed, "byteStride").value_or(0);
            return unpackView(index, packed);
        }
    const std::string_view all = buffer(GltfFile::index(*view, "buffer").value_or(SIZE_MAX));
    const std::size_t offset = GltfFile::index(*view, "byteOffset").value_or(0);
    const std::size_t size = GltfFile::index(*view, "byteLength").value_or(0);
    if (stride) *stride = GltfFile::index(*view, "byteStride").value_or(0);
    if (offset > all.size() || size > all.size() - offset) {
        fault("buffer view " + std::to_string(index) + " of the glTF file reaches beyond its buffer; it is left out");
        return {};
    }
    return all.substr(offset, size);
}

const std::string& GltfFile::unpackView(std::size_t number, const json& packed) {
    const auto [found, isNew] = unpackedViews_.try_emplace(number);
    if (!isNew) return found->second;
    const auto damaged = [&](std::string_view why) -> const std::string& {
        fault("buffer view " + std::to_string(number) + " of the glTF file cannot be unpacked: " + std::string(why));
        return found->second;
    };
    const std::string_view all = buffer(index(packed, "buffer").value_or(SIZE_MAX));
    const std::size_t offset = index(packed, "byteOffset").value_or(0), size = index(packed, "byteLength").value_or(0);
    if (offset > all.size() || size > all.size() - offset) return damaged("it reaches beyond its buffer");
    MeshoptView view{.bytes = all.substr(offset, size),
                     .count = index(packed, "count").value_or(0),
                     .stride = index(packed, "byteStride").value_or(0)};
    const std::string mode = text(packed, "mode"), filter = text(packed, "filter");
    using Mode = MeshoptView::Mode;
    using Filter = MeshoptView::Filter;
    if (mode == "TRIANGLES")
        view.mode = Mode::triangles;
    else if (mode == "INDICES")
        view.mode = Mode::indices;
    else if (mode != "ATTRIBUTES")
        return damaged("it names no mode");
    if (filter == "OCTAHEDRAL")
        view.filter = Filter::octahedral;
    else if (filter == "QUATERNION")
        view.filter = Filter::quaternion;
    else if (filter == "EXPONENTIAL")
        view.filter = Filter::exponential;
    else if (!filter.empty() && filter != "NONE")
        return damaged("its filter is none that is known here: " + filter.substr(0, 40));
    if (const char* why = misfit(view)) return damaged(why);
    const std::uint64_t bytes = std::uint64_t{view.count} * view.stride;
    if (bytes > input_.maximumBytes || !mayHold(bytes)) return damaged("it takes more memory than may be had");
    std::string out;
    if (const char* why = meshopt_(view, out)) return damaged(why);
    return found->second = std::move(out);
}

const json* GltfFile::accessorOf(std::size_t number) {
    if (const auto packed = packedBy_.find(number); packed != packedBy_.end()) {
        json& primitive = *packed->second;
        unpackMesh(primitive);
    }
    return item("accessors", number);
}

void GltfFile::findPacked() {
    const auto meshes = draco_ ? root_.find("meshes") : root_.end();
    if (meshes == root_.end() || !meshes->is_array()) return;
    for (json& mesh : *meshes) {
        if (list(mesh, "primitives").empty()) continue;
        for (json& primitive : mesh["primitives"]) {
            const json& packed = extension(primitive, kDraco);
            if (packed.empty()) continue;
            if (const auto indices = index(primitive, "indices")) packedBy_.try_emplace(*indices, &primitive);
            for (const auto& [name, id] : object(packed, "attributes").items())
                if (const auto accessor = index(object(primitive, "attributes"), name.c_str()))
                    packedBy_.try_emplace(*accessor, &primitive);
        }
    }
}

/// Unpacks all that Draco has of a primitive, and points its accessors to what came out; they have no bytes if it is
/// damaged. It becomes a list of triangles.
void GltfFile::unpackMesh(json& primitive) {
    const json& packed = extension(primitive, kDraco);
    DracoMesh mesh;
    std::vector<std::size_t> accessors;
    if (list(root_, "accessors").empty()) return packedBy_.clear();
    json& all = root_["accessors"];
    const auto take = [&](std::size_t accessor) {
        const auto by = packedBy_.find(accessor);
        if (by == packedBy_.end() || by->second != &primitive || accessor >= all.size()) return false;
        packedBy_.erase(by);
        return all[accessor].is_object();
    };
    for (const auto& [name, id] : object(packed, "attributes").items()) {
        const auto accessor = index(object(primitive, "attributes"), name.c_str());
        if (!accessor || !id.is_number_unsigned() || !take(*accessor)) continue;
        mesh.points = index(all[*accessor], "count").value_or(0);
        mesh.attributes.push_back({id.get<std::uint32_t>(),
                                   index(all[*accessor], "componentType").value_or(0),
                                   componentsOf(text(all[*accessor], "type")),
                                   {}});
        accessors.push_back(*accessor);
    }
    const auto indices = index(primitive, "indices");
    const bool hasIndices = indices && take(*indices);
    if (hasIndices) mesh.indices = index(all[*indices], "count").value_or(0);
    const UnpackLimits limits{input_.maximumBytes, [](std::uint64_t more) { return static_cast<bool>(mayHold(more)); }};
    const char* why = draco_(bufferView(index(packed, "bufferView").value_or(SIZE_MAX)), mesh, limits);
    if (why) fault(std::string("a primitive of the glTF file cannot be unpacked: ") + why);
    const auto give = [&](std::size_t accessor, std::string bytes, std::size_t componentType) {
        all[accessor].erase("byteOffset");
        all[accessor].erase("bufferView");
        if (why) return void(all[accessor]["count"] = 0);
        const std::size_t view = list(root_, "bufferViews").size() + accessor;
        unpackedViews_[view] = std::move(bytes);
        all[accessor]["bufferView"] = view;
        all[accessor]["componentType"] = componentType;
    };
    for (std::size_t i = 0; i < accessors.size(); ++i)
        give(accessors[i], std::move(mesh.attributes[i].bytes), mesh.attributes[i].componentType);
    constexpr std::size_t u32 = 5125, triangleList = 4;
    if (hasIndices) give(*indices, std::move(mesh.indexBytes), u32);
    primitive["mode"] = triangleList;
}

Vec3f GltfFile::shown(const Vec3f& light) const {
    if (input_.displayColors) return light;
    Vec3f result;
    for (int c = 0; c < 3; ++c) {
        // IEC 61966-2-1
        constexpr double linear = .0031308, slope = 12.92, scale = 1.055, offset = .055, power = 1 / 2.4;
        const double value = std::max(0.0, double{light[c]});
        result[c] = static_cast<float>(value <= linear ? slope * value : scale * portable::pow(value, power) - offset);
    }
    return result;
}

/// What messages call it.
std::string GltfFile::nameOf(const json& accessor) const {
    const json& all = list(root_, "accessors");
    const std::less<const json*> before;
    if (all.empty() || before(&accessor, &all.front()) || before(&all.back(), &accessor)) return "a sparse accessor";
    return "accessor " + std::to_string(&accessor - &all.front());
}

/// The elements of an accessor in their buffer; nothing if they do not fit.
std::optional<GltfFile::Elements> GltfFile::elementsOf(const json& accessor, std::size_t components) {
    const auto view = index(accessor, "bufferView");
    const std::size_t count = index(accessor, "count").value_or(0), type = index(accessor, "componentType").value_or(0);
    const std::size_t size = componentSize(type) * components;
    std::size_t stride = 0;
    const std::string_view bytes = view ? bufferView(*view, &stride) : std::string_view();
    const std::size_t offset = index(accessor, "byteOffset").value_or(0);
    if (stride == 0) stride = size;
    if (count == 0 || size == 0) return std::nullopt;  // which has been told
    const auto leftOut = [&](const char* why) -> std::optional<Elements> {
        fault(nameOf(accessor) + " of the glTF file " + why + "; it is left out");
        return std::nullopt;
    };
    if (stride < size) return leftOut("has elements that lie in each other, by the byteStride of its buffer view");
    const bool fits = offset <= bytes.size() && size <= bytes.size() - offset &&
                      (count - 1) <= (bytes.size() - offset - size) / stride;
    constexpr std::size_t kLarge = std::size_t{1} << 20;
    if (fits && count * components > kLarge && !mayHold(2 * sizeof(float) * count * components)) {
        diagnostics_.error({}, "an accessor of the glTF file is left out, as the process may hold no more memory",
                           DiagnosticCode("memory"));
        return std::nullopt;
    }
    if (!fits) return leftOut("reaches beyond its buffer view");
    if (!mayMake(sizeof(float) * count * components)) return std::nullopt;
    return Elements{bytes.data() + offset, count, stride, size, type, flag(accessor, "normalized")};
}

/// take(component's bytes, type, normalized) for each component of each element. False if the accessor does not fit.
template <class Take>
bool GltfFile::forEach(const json& accessor, std::size_t components, const Take& take) {
    const auto all = elementsOf(accessor, components);
    if (!all) return false;
    const char* element = all->first;
    for (std::size_t i = 0; i < all->count; ++i, element += all->stride)
        for (std::size_t k = 0; k < components; ++k)
            take(element + k * componentSize(all->type), all->type, all->normalized);
    return true;
}

/// Copies elements unchanged if the file has them in the type that is wanted.
template <class T, class To>
bool GltfFile::copyAll(const json& accessor, std::size_t components, std::size_t type, To& into) {
    if (index(accessor, "componentType") != type) return false;
    const auto all = elementsOf(accessor, components);
    if (!all) return true;
    into.resize(all->count * components);
    if (into.empty()) return true;
    T* out = nullptr;
    if constexpr (requires { into.mutableData(); })
        out = into.mutableData();
    else
        out = into.data();
    if (all->stride == all->size) {
        std::memcpy(out, all->first, all->count * all->size);
        return true;
    }
    for (std::size_t i = 0; i < all->count; ++i)
        std::memcpy(out + i * components, all->first + i * all->stride, all->size);
    return true;
}

std::optional<GltfFile::Plain> GltfFile::plain(const json& accessor, std::size_t components, std::size_t type) {
    if (componentsOf(text(accessor, "type")) != components || index(accessor, "componentType") != type ||
        !accessor.contains("bufferView") || accessor.contains("sparse"))
        return {};
    const auto all = elementsOf(accessor, components);
    return all ? Plain{all->first, all->count, all->stride} : Plain{nullptr, 0, 0};
}

std::vector<float> GltfFile::floats(std::size_t number, std::size_t& components) {
    std::vector<float> result;
    const json* accessor = accessorOf(number);
    components = accessor ? componentsOf(text(*accessor, "type")) : 0;
    if (components == 0) return result;
    constexpr std::size_t f32 = 5126;
    if (accessor->contains("bufferView")) {
        if (!copyAll<float>(*accessor, components, f32, result) &&
            !forEach(*accessor, components, [&](const char* p, std::size_t type, bool normalized) {
                result.push_back(static_cast<float>(component(p, type, normalized)));
            }))
            return {};
    } else {
        // Zeros, of which a sparse accessor replaces some.
        const std::size_t count = index(*accessor, "count").value_or(0);
        if (!mayTakeZeros(*accessor, count, components) || !mayMake(sizeof(float) * count * components)) return {};
        result.resize(count * components);
    }
    if (accessor->contains("sparse") && !sparse(*accessor, components, result)) return {};
    makeFinite(result);
    return result;
}

/// Nothing stands for them in the file; but a mesh has bytes for each of its points, and so many morph targets of it.
bool GltfFile::mayTakeZeros(const json& accessor, std::size_t count, std::size_t components) {
    constexpr std::size_t kOfByte = 16;
    if (zeroed_.contains(&accessor)) return true;  // read once more
    bufferView(index(object(object(accessor, "sparse"), "indices"), "bufferView").value_or(SIZE_MAX));
    std::size_t bytes = input_.bytes.size();
    for (const auto& buffer : buffers_) bytes += buffer ? buffer->size() : 0;
    const std::size_t left = kOfByte * bytes - std::min(zeros_, kOfByte * bytes);
    if (count > left / components) {
        fault(nameOf(accessor) + " of the glTF file counts " + std::to_string(count) +
              " elements, more than there can be without bytes of their own; it is left out");
        return false;
    }
    zeros_ += count * components;
    zeroed_.insert(&accessor);
    return true;
}

bool GltfFile::sparse(const json& accessor, std::size_t components, std::vector<float>& into) {
    const json& sparse = object(accessor, "sparse");
    json where = object(sparse, "indices"), values = object(sparse, "values");
    const std::size_t count = index(sparse, "count").value_or(0);
    where["count"] = values["count"] = count;
    values["componentType"] = index(accessor, "componentType").value_or(0);
    values["normalized"] = flag(accessor, "normalized");
    if (index(where, "componentType") == 5126) return false;
    std::vector<std::size_t> indices;
    if (!forEach(where, 1, [&](const char* p, std::size_t type, bool) {
            indices.push_back(static_cast<std::size_t>(component(p, type, false)));
        }))
        return false;
    if (std::ranges::any_of(indices, [&](std::size_t number) { return number >= into.size() / components; })) {
        fault(nameOf(accessor) + " of the glTF file is sparse, with indices beyond its elements; it is left out");
        return false;
    }
    std::size_t i = 0;
    return forEach(values, components, [&](const char* p, std::size_t type, bool normalized) {
        into[indices[i / components] * components + i % components] =
            static_cast<float>(component(p, type, normalized));
        ++i;
    });
}

Array<std::int32_t> GltfFile::indices(std::size_t number) {
    Array<std::int32_t> result;
    const json* accessor = accessorOf(number);
    const std::size_t kind = accessor ? index(*accessor, "componentType").value_or(0) : 0;
    if (!accessor || index(*accessor, "count").value_or(0) == 0) return result;
    if (text(*accessor, "type") != "SCALAR" || (kind != 5121 && kind != 5123 && kind != 5125) ||
        !accessor->contains("bufferView") || accessor->contains("sparse")) {
        fault(nameOf(*accessor) + " of the glTF file is no plain list of indices; what it is for is left out");
        return result;
    }
    constexpr std::size_t u32 = 5125;
    if (copyAll<std::int32_t>(*accessor, 1, u32, result)) return result;
    const bool good = forEach(*accessor, 1, [&](const char* p, std::size_t type, bool) {
        const double index = component(p, type, false);
        result.push_back(index >= 0 && index <= 2147483647.0 ? static_cast<std::int32_t>(index) : -1);
    });
    return good ? result : Array<std::int32_t>();
}

}  // namespace rtsg::detail
