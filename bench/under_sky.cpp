// Makes a bench's scene matte and lit by the sky alone, pictures it, and writes it for others.
#include "under_sky.h"

#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/shared_world.h>

#include "bench.h"
#include "scenes/scenes.h"

namespace rtsg::bench {

namespace {

template <class T>
void put(std::ostream& out, const T* values, std::size_t count) {
    out.write(reinterpret_cast<const char*>(values), static_cast<std::streamsize>(count * sizeof(T)));
}
void put(std::ostream& out, std::size_t number) {
    const auto n = static_cast<std::uint32_t>(number);
    put(out, &n, 1);
}

/// Sets a field of that name if the node has one of that type.
template <class T>
void setField(Scene& scene, NodeId id, std::string_view name, const T& value, FieldType type) {
    const NodeType& of = scene.node(id).type();
    const FieldIndex field = of.findExact(name);
    if (field == kNoField || of.fields[field].type != type) return;
    if (!scene.setField(id, field, Value(value)))
        throw std::runtime_error("the bench's scene could not be made matte: " + std::string(name));
}

void makeMatte(Scene& scene) {
    std::vector<NodeId> ids;
    scene.forEachNode([&](const Node& node) { ids.push_back(node.id()); });
    for (const NodeId id : ids) {
        const std::string_view type = scene.node(id).type().name;
        if (type.ends_with("Light")) setField(scene, id, "on", false, FieldType::SFBool);
        if (type.ends_with("Background")) {
            setField(scene, id, "skyColor", Array<Color>{{1, 1, 1}}, FieldType::MFColor);
            setField(scene, id, "groundColor", Array<Color>{}, FieldType::MFColor);
            setField(scene, id, "skyAngle", Array<float>{}, FieldType::MFFloat);
            setField(scene, id, "groundAngle", Array<float>{}, FieldType::MFFloat);
        }
        setField(scene, id, "headlight", false, FieldType::SFBool);
        setField(scene, id, "solid", false, FieldType::SFBool);
        for (const char* name : {"transparency", "visibilityRange", "visibilityLimit"})
            setField(scene, id, name, 0.0f, FieldType::SFFloat);
        setField(scene, id, "specularColor", Color{0, 0, 0}, FieldType::SFColor);
        setField(scene, id, "emissiveColor", Color{0, 0, 0}, FieldType::SFColor);
        for (const char* name : {"metadata", "texture", "color"})
            setField(scene, id, name, NodeId{}, FieldType::SFNode);
    }
}

Color colorOf(const Scene& scene, NodeId appearance) {
    const Node* node = scene.find(appearance);
    const Node* material =
        node && node->is(x3d::Appearance::type) ? scene.find(node->get(x3d::Appearance::material)) : nullptr;
    return material && material->is(x3d::Material::type) ? material->get(x3d::Material::diffuseColor) : Color{1, 1, 1};
}

double meanOf(const Picture& picture) {
    double sum = 0;
    for (const Vec4f& pixel : picture.pixels) sum += double{pixel.r} + double{pixel.g} + double{pixel.b};
    return sum / (3.0 * static_cast<double>(picture.pixels.size()));
}

/// The error as RenderStats::error has it, root mean square over the pixels: of one of two pictures with different
/// seeds, or the difference of a picture from the truth.
double errorOf(const Picture& picture, const Picture& truth, bool isTruth) {
    const double floor = double{kErrorFloor} * averageLight(truth);
    double squares = 0;
    for (std::size_t i = 0; i < truth.pixels.size(); ++i) {
        const Vec3f a(picture.pixels[i]), b(truth.pixels[i]), right = isTruth ? b : .5f * (a + b);
        int brightest = 0;
        for (int c = 1; c < 3; ++c)
            if (right[c] > right[brightest]) brightest = c;
        squares += std::pow(double{a[brightest] - b[brightest]} / (double{right[brightest]} + floor), 2);
    }
    return std::sqrt(squares / static_cast<double>(truth.pixels.size()) / (isTruth ? 1 : 2));
}

}  // namespace

UnderSky::UnderSky(std::string_view name, double scale) : scene_(std::make_unique<Scene>()) {
    const auto folder = std::filesystem::temp_directory_path() / fmt::format("rtsg_under_sky_{}", ::getpid());
    std::filesystem::create_directories(folder);
    const auto written = writeBenchScene(name, scale, false, folder);
    Diagnostics diagnostics;
    const bool loaded = written && loadFile(*scene_, folder / fmt::format("{}.x3dv", name), diagnostics);
    std::filesystem::remove_all(folder);
    if (!loaded) throw std::runtime_error(fmt::format("the bench's scene {} could not be made", name));
    triangles_ = static_cast<std::size_t>(*written);
    makeMatte(*scene_);
    scene_->newFrame(0);
}

UnderSky::Known UnderSky::take(const ImageOptions& options) const {
    Known known;
    RenderStats stats;
    const double start = cpuSeconds();
    SharedWorld world(*scene_, {.flattening = {}, .rays = {.buildThreads = 1}});
    LightRenderer light(world);
    auto picture = light.picture(options, &stats);
    known.seconds = cpuSeconds() - start;
    if (!picture) throw std::runtime_error(picture.error().text);
    known.picture = std::move(*picture);
    known.error = stats.error, known.mean = meanOf(known.picture);
    known.rays = static_cast<double>(stats.primaryRays + stats.shadowRays + stats.secondaryRays);
    return known;
}

ImageOptions pathOptions(int side, double error, int maximum) {
    ImageOptions options;
    options.settings.integrator = Integrator::path;
    options.settings.width = options.settings.height = side;
    options.settings.threads = 1;
    options.settings.error = static_cast<float>(error);
    options.settings.samplesPerPixel = maximum;
    return options;
}

UnderSky::Known UnderSky::picture(int side, double error, int maximum) const {
    ImageOptions options = pathOptions(side, error, maximum);
    Known known = take(options);
    options.settings.seed = 2;
    const Known other = take(options);
    known.seconds = (known.seconds + other.seconds) / 2;
    known.error = errorOf(known.picture, other.picture, false);
    return known;
}

UnderSky::Known UnderSky::whitted(int side, const Picture& truth) const {
    ImageOptions options;
    options.settings.colorSpace = ColorSpace::linear;
    options.settings.width = options.settings.height = side;
    options.settings.threads = 1;
    options.settings.samplesPerPixel = 16;
    Known known = take(options);
    known.error = errorOf(known.picture, truth, true);
    return known;
}

double UnderSky::errorFrom(const Picture& picture, const Picture& truth) {
    return errorOf(picture, truth, true);
}

UnderSky::Content UnderSky::content() const {
    Content content;
    content.world = std::make_unique<SharedWorld>(*scene_);
    LightRenderer light(*content.world);
    ImageOptions options;
    options.settings.width = options.settings.height = 1;
    if (!light.picture(options)) throw std::runtime_error("the bench's scene has no eye");
    content.eye = light.camera();
    std::map<const Mesh*, std::size_t> numbers;
    for (const RayInstance& instance : content.world->rays().instances()) {
        if (!instance.info.id || !instance.mesh || instance.mesh->empty() || !instance.info.seen) continue;
        const auto [known, isNew] = numbers.emplace(instance.mesh.get(), content.meshes.size());
        if (isNew) content.meshes.push_back(instance.mesh.get());
        content.items.push_back(
            {known->second, colorOf(*scene_, instance.info.appearance), instance.info.worldFromLocal});
    }
    return content;
}

void UnderSky::write(const std::filesystem::path& file) const {
    const Content content = this->content();
    const Camera& eye = content.eye;
    std::ofstream out(file, std::ios::binary);
    for (const Vec3d& v : {eye.right, eye.up, eye.forward, eye.position}) put(out, &v.x, 3);
    put(out, &eye.top, 1);
    put(out, content.meshes.size());
    for (const Mesh* mesh : content.meshes) {
        put(out, mesh->positions.size()), put(out, mesh->triangleCount);
        put(out, mesh->positions.data(), mesh->positions.size());
        for (std::uint32_t t = 0; t < mesh->triangleCount; ++t)
            for (std::uint32_t c = 0; c < 3; ++c) put(out, mesh->vertexIndex(t, c));
    }
    put(out, content.items.size());
    for (const Item& item : content.items) {
        put(out, item.mesh);
        put(out, &item.color.r, 3);
        for (int k = 0; k < 4; ++k) put(out, &item.worldFromLocal[k].x, 3);
    }
    if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

void UnderSky::writePov(const std::filesystem::path& file) const {
    const Content content = this->content();
    const Camera& eye = content.eye;
    std::ofstream out(file);
    const auto vector = [](const Vec3d& v) { return fmt::format("<{}, {}, {}>", v.x, v.y, v.z); };
    out << "#version 3.7;\nglobal_settings { assumed_gamma 1 ambient_light 0 radiosity { pretrace_start .08 "
           "pretrace_end .01 count rays nearest_count 8 error_bound .4 recursion_limit 4 brightness 1 } }\n"
           "background { rgb 1 }\n#default { finish { ambient 0 emission 0 diffuse 1 } }\n"
        << fmt::format("camera {{ perspective location {} right {} up {} direction {} }}\n", vector(eye.position),
                       vector(2 * eye.top * eye.right), vector(2 * eye.top * eye.up), vector(eye.forward));
    for (std::size_t i = 0; i < content.meshes.size(); ++i) {
        const Mesh& mesh = *content.meshes[i];
        out << fmt::format("#declare M{} = mesh2 {{ vertex_vectors {{ {}", i, mesh.positions.size());
        for (const Vec3f& v : mesh.positions) out << ',' << vector(Vec3d(v));
        out << fmt::format(" }} face_indices {{ {}", mesh.triangleCount);
        for (std::uint32_t t = 0; t < mesh.triangleCount; ++t)
            out << fmt::format(",<{}, {}, {}>", mesh.vertexIndex(t, 0), mesh.vertexIndex(t, 1), mesh.vertexIndex(t, 2));
        out << " } }\n";
    }
    for (const Item& item : content.items) {
        out << fmt::format("object {{ M{} matrix <", item.mesh);
        for (int k = 0; k < 4; ++k)
            out << fmt::format("{}{}, {}, {}", k ? ", " : "", item.worldFromLocal[k].x, item.worldFromLocal[k].y,
                               item.worldFromLocal[k].z);
        const Vec3f c = linearFromSrgb(Vec3f(item.color.r, item.color.g, item.color.b));
        out << fmt::format("> pigment {{ rgb {} }} }}\n", vector(Vec3d(c)));
    }
    if (!out.flush()) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace rtsg::bench
