// Writes primitives as shapes, from their accessors and morph targets.
#include "gltf_mesh.h"

#include <algorithm>
#include <map>
#include <numeric>

#include <fmt/format.h>

namespace rtsg::detail {

using nlohmann::json;

namespace {

template <class T>
Array<T> elements(const std::vector<float>& numbers, std::size_t stride) {
    Array<T> result;
    constexpr std::size_t size = sizeof(T) / sizeof(float);
    if (stride < size) return result;
    result.resize(numbers.size() / stride);
    T* out = result.mutableData();
    if (stride == size) {
        std::copy_n(numbers.data(), result.size() * size, reinterpret_cast<float*>(out));
        return result;
    }
    for (std::size_t i = 0; i < result.size(); ++i)
        std::copy_n(numbers.data() + i * stride, size, reinterpret_cast<float*>(out + i));
    return result;
}

Array<std::int32_t> triangles(const Array<std::int32_t>& indices, std::size_t mode) {
    if (mode == 4) {
        Array<std::int32_t> whole = indices;
        whole.resize(indices.size() / 3 * 3);
        return whole;
    }
    Array<std::int32_t> result;
    for (std::size_t i = 2; i < indices.size(); ++i) {
        const bool turned = mode == 5 && i % 2 != 0;
        const std::int32_t first = mode == 6 ? indices[0] : indices[turned ? i - 1 : i - 2];
        const std::int32_t second = mode == 6 ? indices[i - 1] : indices[turned ? i - 2 : i - 1];
        result.push_back(first);
        result.push_back(second);
        result.push_back(indices[i]);
    }
    return result;
}

}  // namespace

template <class T>
Array<T> GltfMeshes::attribute(const json& attributes, const char* name, std::size_t points) {
    const auto accessor = GltfFile::index(attributes, name);
    if (!accessor) return {};
    const auto leftOut = [&](const std::string& why) {
        file_.fault(fmt::format("accessor {} of the glTF file, for {}, {}; it is left out", *accessor, name, why));
        return Array<T>();
    };
    const auto matching = [&](Array<T> all) {
        if (points == 0 || all.empty() || all.size() == points) return all;
        return leftOut(fmt::format("has {} elements where there are {} points", all.size(), points));
    };
    if (std::optional<Array<T>> direct = file_.floatArray<T>(*accessor)) return matching(*std::move(direct));
    std::size_t stride = 0;
    const std::vector<float> numbers = file_.floats(*accessor, stride);
    if (numbers.empty()) return {};  // which has been told
    constexpr std::size_t size = sizeof(T) / sizeof(float);
    constexpr bool isColor = std::is_same_v<T, ColorRGBA>;
    if (stride != size && !(isColor && stride == 3))
        return leftOut(fmt::format("has elements of {} numbers instead of {}", stride, size));
    Array<T> result;
    if constexpr (isColor) {
        result.resize(stride >= 3 ? numbers.size() / stride : 0);
        for (std::size_t i = 0; i < result.size(); ++i)
            result.mutableData()[i] = {numbers[i * stride], numbers[i * stride + 1], numbers[i * stride + 2],
                                       stride > 3 ? numbers[i * stride + 3] : 1};
    } else {
        result = elements<T>(numbers, stride);
    }
    return matching(std::move(result));
}

void GltfMeshes::morph(const json& primitive, const char* name, const std::vector<double>& weights,
                       Array<Vec3f>& values) {
    const json& targets = GltfFile::list(primitive, "targets");
    if (weights.size() > targets.size()) file_.fault("a mesh of the glTF file has more weights than targets");
    for (std::size_t t = 0; t < std::min(targets.size(), weights.size()); ++t) {
        if (weights[t] == 0 || values.empty()) continue;
        const Array<Vec3f> moves = attribute<Vec3f>(targets[t], name, values.size());
        if (moves.empty()) continue;
        Vec3f* const out = values.mutableData();
        for (std::size_t i = 0; i < values.size(); ++i) out[i] += static_cast<float>(weights[t]) * moves[i];
    }
}

/// 3.7.2.1: tangents without normals are ignored; and they serve normal textures alone.
bool GltfMeshes::usesTangents(const json& primitive, std::size_t material) {
    const json& attributes = GltfFile::object(primitive, "attributes");
    if (!attributes.contains("TANGENT") || !attributes.contains("NORMAL")) return false;
    const json& materials = GltfFile::list(file_.root(), "materials");
    return material < materials.size() && materials[material].is_object() &&
           materials[material].contains("normalTexture");
}

bool GltfMeshes::hasTangents() {
    for (const json& mesh : GltfFile::list(file_.root(), "meshes"))
        for (const json& primitive : GltfFile::list(mesh, "primitives")) {
            const std::size_t own = GltfFile::index(primitive, "material").value_or(kNoIndex);
            std::vector<std::size_t> choices = variantsOf(primitive, own);
            choices.push_back(own);
            for (const std::size_t material : choices)
                if (usesTangents(primitive, material)) return true;
        }
    return false;
}

/// Targets move the direction; which side of it is left stays as it is.
void GltfMeshes::morphTangents(const json& primitive, const std::vector<double>& weights, Array<Vec4f>& tangents) {
    if (tangents.empty() || weights.empty()) return;
    Array<Vec3f> directions;
    for (const Vec4f& tangent : tangents) directions.push_back(Vec3f(tangent));
    morph(primitive, "TANGENT", weights, directions);
    Vec4f* const out = tangents.mutableData();
    for (std::size_t i = 0; i < directions.size(); ++i) out[i] = Vec4f(directions[i], out[i].w);
}

Array<Vec2f> GltfMeshes::texCoords(const json& attributes, std::size_t set, std::size_t points) {
    Array<Vec2f> result = attribute<Vec2f>(attributes, ("TEXCOORD_" + std::to_string(set)).c_str(), points);
    // The origin of a picture is its upper left corner there, its lower left one here.
    for (std::size_t i = 0; i < result.size(); ++i) result.mutableData()[i].y = 1 - result.mutableData()[i].y;
    return result;
}

void GltfMeshes::takeTexCoords(const json& attributes, const json* material, ImportedMesh& mesh) {
    const std::vector<GltfMapping> mappings = GltfMaterials::mappingsOf(material);
    if (mappings.empty()) {
        mesh.texCoords = texCoords(attributes, 0, mesh.points.size());
        return;
    }
    std::map<std::size_t, Array<Vec2f>> sets;  // each once, however many names it has
    for (const GltfMapping& mapping : mappings) {
        const auto [set, isNew] = sets.try_emplace(mapping.lookup.set);
        if (isNew) set->second = texCoords(attributes, set->first, mesh.points.size());
        if (set->second.empty() && isNew)
            file_.warn(
                fmt::format("a primitive of the glTF file has no TEXCOORD_{}, which its material asks for; the "
                            "first set is taken",
                            set->first));
        if (set->second.empty()) set->second = texCoords(attributes, 0, mesh.points.size());
        if (!set->second.empty()) mesh.namedTexCoords.push_back({mapping.name, set->second});
    }
}

void GltfMeshes::takeColors(const json& attributes, const json* material, bool strokes, ImportedMesh& mesh) {
    mesh.colors = attribute<ColorRGBA>(attributes, "COLOR_0", mesh.points.size());
    if (mesh.colors.empty()) return;
    const ColorRGBA base = GltfMaterials::baseColor(material);
    const Vec3f more = strokes ? GltfMaterials::emission(material) : Vec3f(0);
    const bool isShown = strokes || (material && GltfMaterials::isUnlit(*material));
    if (base == ColorRGBA{1, 1, 1, 1} && more == Vec3f(0) && !isShown) return;
    ColorRGBA* const colors = mesh.colors.mutableData();
    for (std::size_t i = 0; i < mesh.colors.size(); ++i) {
        const Vec3f light = Vec3f(colors[i].r * base.r, colors[i].g * base.g, colors[i].b * base.b) + more;
        const Vec3f color = isShown ? file_.shown(light) : light;
        colors[i] = {color.x, color.y, color.z, colors[i].a * base.a};
    }
}

void GltfMeshes::reportWithoutPoints(const json& attributes) {
    if (!attributes.contains("POSITION")) file_.warn("a primitive of the glTF file has no positions; it is left out");
}

void GltfMeshes::warnOfTextures(const json* material) {
    if (material && GltfFile::object(*material, "pbrMetallicRoughness").contains("baseColorTexture"))
        file_.warn("lines and points of the glTF file have textures; they are drawn in the colour alone");
}

std::vector<std::size_t> GltfMeshes::variantsOf(const json& primitive, std::size_t material) {
    const json& all = GltfFile::list(GltfFile::extension(file_.root(), "KHR_materials_variants"), "variants");
    const json& mappings = GltfFile::list(GltfFile::extension(primitive, "KHR_materials_variants"), "mappings");
    if (all.empty() || mappings.empty()) return {};
    std::vector<std::size_t> result(all.size(), material);
    for (const json& mapping : mappings)
        for (const json& variant : GltfFile::list(mapping, "variants"))
            if (variant.is_number_unsigned() && variant.get<std::size_t>() < result.size())
                result[variant.get<std::size_t>()] = GltfFile::index(mapping, "material").value_or(material);
    return result;
}

/// Each material of a primitive has points of its own, as textures may be looked up otherwise there.
bool GltfMeshes::mayCopy(const json& primitive, const std::vector<std::size_t>& choices) {
    const std::size_t position =
        GltfFile::index(GltfFile::object(primitive, "attributes"), "POSITION").value_or(kNoIndex);
    const json& accessors = GltfFile::list(file_.root(), "accessors");
    const std::size_t points =
        position < accessors.size() ? GltfFile::index(accessors[position], "count").value_or(0) : 0;
    const std::size_t materials = std::set<std::size_t>(choices.begin(), choices.end()).size();
    constexpr std::size_t maximum = std::size_t{1} << 24;  // points and choices in all
    if (choices.size() > maximum - copied_ || points > (maximum - copied_ - choices.size()) / materials) return false;
    copied_ += choices.size() + points * materials;
    return true;
}

void GltfMeshes::writePrimitive(const json& primitive, const GltfForm& form, bool skinned) {
    constexpr std::uint64_t bytes = 1024;  // of its nodes
    if (!file_.mayMake(bytes)) return;
    const std::size_t own = GltfFile::index(primitive, "material").value_or(kNoIndex);
    std::vector<std::size_t> choices = variantsOf(primitive, own);
    if (!choices.empty() && (skinned || !form.points.empty())) {
        file_.warn("variants of the glTF file change what moves by joints or weights; it keeps its own material");
        choices.clear();
    }
    if (!choices.empty() && !mayCopy(primitive, choices)) {
        file_.warn("variants of the glTF file's materials are too many; what has them keeps its own");
        choices.clear();
    }
    if (choices.empty()) return writeShape(primitive, form, skinned, own, {});
    choices.insert(choices.begin(), own);
    switches_.push_back(names_.take("variants_of_" + std::to_string(switches_.size())));
    GltfNode choice(out_, "Switch", "children", switches_.back());
    choice.set("whichChoice", std::int32_t{0});
    std::map<std::size_t, std::string> given;
    for (const std::size_t material : choices) {
        const auto [shape, isNew] = given.try_emplace(material);
        if (!isNew) {
            out_.useNode(shape->second, "children", {});
            continue;
        }
        shape->second = names_.take(switches_.back() + "_shape" + std::to_string(given.size() - 1));
        writeShape(primitive, form, skinned, material, shape->second);
    }
}

void GltfMeshes::writeVariants() {
    if (switches_.empty()) return;
    const std::string hub = names_.take("variants");
    GltfNode(out_, "Switch", {}, hub).set("whichChoice", std::int32_t{0});
    std::int32_t number = 0;
    for (const json& variant :
         GltfFile::list(GltfFile::extension(file_.root(), "KHR_materials_variants"), "variants")) {
        const std::string name = GltfFile::text(variant, "name");
        const std::string def =
            name.empty() ? names_.take("variant" + std::to_string(number)) : names_.take(name, "variant");
        GltfNode(out_, "IntegerTrigger", {}, def).set("integerKey", ++number);
        out_.route(def, "triggerValue", hub, "whichChoice", {});
    }
    for (const std::string& one : switches_) out_.route(hub, "whichChoice", one, "whichChoice", {});
}

void GltfMeshes::writeShape(const json& primitive, const GltfForm& form, bool skinned, std::size_t number,
                            const std::string& def) {
    const json& attributes = GltfFile::object(primitive, "attributes");
    ImportedMesh mesh;
    mesh.points = attribute<Vec3f>(attributes, "POSITION", 0);
    const std::size_t count = mesh.points.size();
    if (count == 0) return reportWithoutPoints(attributes);
    morph(primitive, "POSITION", form.weights, mesh.points);
    Array<std::int32_t> indices;
    if (const auto accessor = GltfFile::index(primitive, "indices")) {
        indices = file_.indices(*accessor);
    } else {
        indices.resize(count);
        std::iota(indices.mutableData(), indices.mutableData() + count, 0);
    }
    std::uint32_t maximum = 0;  // negative ones are large
    for (const std::int32_t i : indices) maximum = std::max(maximum, static_cast<std::uint32_t>(i));
    if (maximum >= count)
        return file_.fault("a primitive of the glTF file has indices beyond its points; it is left out");
    const std::size_t mode = GltfFile::index(primitive, "mode").value_or(4);
    if (mode > 6) return;  // which has been told
    constexpr std::size_t lines = 1, triangleList = 4;
    if ((mode == triangleList && indices.size() % 3 != 0) || (mode == lines && indices.size() % 2 != 0))
        file_.fault("a primitive of the glTF file has another number of indices than its triangles or lines need");
    mesh.normals = attribute<Vec3f>(attributes, "NORMAL", count);
    morph(primitive, "NORMAL", form.weights, mesh.normals);
    const bool smooth = !mesh.normals.empty();
    // Moving meshes get no normals here: these follow from where their points are.
    if (skinned || !form.points.empty()) mesh.normals = {};
    if (!mesh.normals.empty() && usesTangents(primitive, number)) {
        mesh.tangents = attribute<Vec4f>(attributes, "TANGENT", count);
        morphTangents(primitive, form.weights, mesh.tangents);
    }
    mesh.smooth = smooth;  // without normals faces are flat
    mesh.pointsName = form.points;
    mesh.pointsGiven = skinned;
    const json* material = file_.item("materials", number);
    mesh.solid = !(material && GltfFile::flag(*material, "doubleSided"));
    const bool strokes = mode <= 3 && mesh.normals.empty();
    takeColors(attributes, material, strokes, mesh);
    if (strokes)
        warnOfTextures(material);
    else
        takeTexCoords(attributes, material, mesh);
    if (!form.points.empty()) points_.insert(form.points);
    GltfNode shape(out_, "Shape", skinned ? "skin" : "children", def);
    materials_.writeAppearance(number, material, strokes);
    if (mode == 0) {
        mesh.faces = {};
        return writeMesh(out_, std::move(mesh));
    }
    if (mode <= 3) return writeLines(mesh, indices, mode);
    mesh.triangles = true;
    mesh.faces = triangles(indices, mode);
    if (!mesh.faces.empty()) writeMesh(out_, std::move(mesh));
}

void GltfMeshes::writeLines(ImportedMesh& mesh, const Array<std::int32_t>& indices, std::size_t mode) {
    Array<std::int32_t> lines;
    for (std::size_t i = 0; i < indices.size(); ++i) {
        lines.push_back(indices[i]);
        if (mode == 1 && i % 2 == 1) lines.push_back(-1);
    }
    if (mode == 2 && !indices.empty()) lines.push_back(indices[0]);
    GltfNode set(out_, "IndexedLineSet", "geometry");
    set.set("coordIndex", std::move(lines));
    if (mesh.pointsGiven) {
        out_.useNode(mesh.pointsName, "coord", {});
    } else {
        GltfNode coordinate(out_, "Coordinate", "coord", mesh.pointsName);
        coordinate.set("point", std::move(mesh.points));
    }
    if (!mesh.normals.empty()) GltfNode(out_, "Normal", "normal").set("vector", std::move(mesh.normals));
    if (!mesh.colors.empty()) GltfNode(out_, "ColorRGBA", "color").set("color", std::move(mesh.colors));
}

}  // namespace rtsg::detail
