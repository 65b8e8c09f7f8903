// Binds pictures, picking and measured light.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <rtsg/renderers/irradiance.h>
#include <rtsg/renderers/picking.h>
#include <rtsg/renderers/tessellator.h>

#include "errors.h"
#include "module.h"
#include "unlocked.h"
#include "values.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {

// ---- pictures ------------------------------------------------------------------------------------------------------

struct PictureRequest {
    ImageOptions image;
    std::string format;
};

template <class T>
T choose(const std::string& what, const std::string& word, std::initializer_list<std::pair<const char*, T>> choices) {
    std::string all;
    for (const auto& [name, value] : choices) {
        if (word == name) return value;
        all += std::string(all.empty() ? "" : ", ") + "\"" + name + "\"";
    }
    throw py::value_error(fmt::format("{} is one of {}, not \"{}\"", what, all, word));
}

Shadows shadowsNamed(const std::string& word) {
    return choose<Shadows>("shadows", word,
                           {{"auto", Shadows::automatic},
                            {"authored", Shadows::authored},
                            {"all", Shadows::all},
                            {"none", Shadows::none}});
}

/// A layer: its name here, its bit, and how the names of its channels begin.
struct LayerName {
    const char *name, *channel;
    DataLayer bit;
};
constexpr LayerName kLayers[] = {{"depth", "Z", kDepth},    {"position", "P.", kPosition},
                                 {"normal", "N.", kNormal}, {"albedo", "albedo", kAlbedo},
                                 {"ids", "node.id", kNode}, {"motion", "motion", kMotion}};

std::uint32_t layersNamed(const std::vector<std::string>& names) {
    std::uint32_t bits = 0;
    for (const std::string& name : names)
        bits |= choose<DataLayer>("a layer", name,
                                  {{"depth", kDepth},
                                   {"position", kPosition},
                                   {"normal", kNormal},
                                   {"albedo", kAlbedo},
                                   {"ids", kNode},
                                   {"motion", kMotion}});
    return bits;
}

/// The option's value; a TypeError that names the option, what it is and what was given.
template <class T>
T optionOf(const std::string& name, const py::handle& value, std::string_view expected) {
    try {
        return py::cast<T>(value);
    } catch (const py::cast_error&) {
        throw py::type_error(
            fmt::format("the option {} is {}, not {}", name, expected, py::cast<std::string>(py::repr(value))));
    }
}

PictureRequest requestOf(const py::kwargs& options) {
    PictureRequest request;
    RenderSettings& settings = request.image.settings;
    settings.width = 640, settings.height = 360, settings.samplesPerPixel = 4;
    request.format = "rgb";
    for (const auto& [key, value] : options) {
        const auto name = py::cast<std::string>(key);
        const auto given = [&, &value = value]<class T>(T& to, std::string_view expected) {
            to = optionOf<T>(name, value, expected);
        };
        const auto word = [&, &value = value] { return optionOf<std::string>(name, value, "a text"); };
        constexpr std::string_view kWhole = "a whole number", kNumber = "a number";
        if (name == "width")
            given(settings.width, kWhole);
        else if (name == "height")
            given(settings.height, kWhole);
        else if (name == "samples")
            given(settings.samplesPerPixel, kWhole);
        else if (name == "error")
            given(settings.error, kNumber);
        else if (name == "seed")
            given(settings.seed, "a whole number from 0");
        else if (name == "threads")
            given(settings.threads, "a whole number from 0");
        else if (name == "shutter")
            given(settings.shutter, "a number from 0 to 1");
        else if (name == "viewpoint")
            request.image.viewpoint = word();
        else if (name == "panorama")
            given(request.image.panorama, "True or False");
        else if (name == "shadows")
            settings.shadows = shadowsNamed(word());
        else if (name == "integrator")
            settings.integrator =
                choose<Integrator>(name, word(), {{"whitted", Integrator::whitted}, {"path", Integrator::path}});
        else if (name == "format")
            request.format = word();
        else
            throw py::type_error("render() has no option " + name);
    }
    (void)choose<int>("format", request.format, {{"rgb", 0}, {"rgba", 0}, {"linear", 0}});
    return request;
}

py::array colours(const Picture& picture, const std::string& format) {
    const py::ssize_t height = picture.height, width = picture.width;
    if (format == "linear") {
        const Picture linear = unlocked([&] { return toLinear(picture); });
        return py::array_t<float>({height, width, py::ssize_t{4}}, &linear.pixels.front().x);
    }
    const std::vector<std::uint8_t> bytes = unlocked([&] { return toSrgb8(picture); });
    if (format == "rgba") return py::array_t<std::uint8_t>({height, width, py::ssize_t{4}}, bytes.data());
    py::array_t<std::uint8_t> array({height, width, py::ssize_t{3}});
    std::uint8_t* to = array.mutable_data();
    for (std::size_t i = 0; i < bytes.size(); i += 4, to += 3) std::memcpy(to, &bytes[i], 3);
    return array;
}

void takeLayers(const Picture& picture, py::dict& into) {
    for (const PictureLayer& layer : picture.layers) {
        const auto* const known = std::ranges::find_if(
            kLayers, [&](const LayerName& one) { return layer.channels.front().starts_with(one.channel); });
        if (known == std::end(kLayers)) continue;
        std::vector<py::ssize_t> shape{picture.height, picture.width};
        if (layer.channels.size() > 1) shape.push_back(static_cast<py::ssize_t>(layer.channels.size()));
        if (layer.integers)
            into[known->name] = py::array(py::dtype::of<std::uint32_t>(), shape, layer.values.data());
        else
            into[known->name] = py::array(py::dtype::of<float>(), shape, layer.values.data());
    }
}

Picture makePicture(SceneHandle& handle, PictureRequest& request) {
    (void)handle.between();
    Interruption interruption;
    request.image.settings.progress = [&](double) { return !interruption(); };
    RenderStats stats;
    auto picture = handle.work([&] { return handle.light().picture(request.image, &stats); });
    handle.raisePending();
    if (stats.cancelled) interruption.raise();
    if (!picture) raise(picture.error());
    if (request.image.settings.error > 0 && stats.unreached > 0)
        warn(fmt::format("the picture's error is {:.2g}: {:g} needs more than {} samples a pixel", stats.error,
                         request.image.settings.error, request.image.settings.samplesPerPixel));
    return std::move(*picture);
}

py::array render(SceneHandle& handle, const py::kwargs& options) {
    PictureRequest request = requestOf(options);
    return colours(makePicture(handle, request), request.format);
}

py::dict renderLayers(SceneHandle& handle, const std::vector<std::string>& layers, const py::kwargs& options) {
    PictureRequest request = requestOf(options);
    request.image.settings.layers = layersNamed(layers);
    const Picture picture = makePicture(handle, request);
    py::dict result;
    result["rgb"] = colours(picture, request.format);
    takeLayers(picture, result);
    if (!picture.interval.empty())
        result["interval"] = py::array_t<float>(
            {py::ssize_t{picture.height}, py::ssize_t{picture.width}, py::ssize_t{3}}, &picture.interval.front().x);
    return result;
}

// ---- picking -------------------------------------------------------------------------------------------------------

Vec3d positionFrom(const py::object& object, const char* what) {
    const Numbers numbers = numbersFrom(FieldType::SFVec3d, object, what);
    const auto* const at = static_cast<const double*>(numbers.array.data());
    return {at[0], at[1], at[2]};
}

py::object arrayOf(const Vec3d& v) {
    return py::array_t<double>(3, &v.x);
}

py::object toPython(const Pick& pick, const py::object& scene) {
    if (!pick) return py::none();
    py::tuple path(pick.path.size());
    for (std::size_t i = 0; i < pick.path.size(); ++i) path[i] = nodeOrNone(scene, pick.path[i]);
    return py::module_::import("rtsg._types")
        .attr("Pick")(nodeOrNone(scene, pick.shape), path, arrayOf(pick.point), arrayOf(pick.normal), pick.distance,
                      py::make_tuple(pick.texCoord.x, pick.texCoord.y), pick.triangle);
}

template <class Ask>
py::object ask(const py::object& self, Ask how) {
    auto& handle = py::cast<SceneHandle&>(self);
    (void)handle.between();
    auto found = handle.work([&]() -> Result<Pick> {
        SharedWorld& world = handle.world();
        if (auto ok = world.update(); !ok) return std::unexpected(ok.error());
        return how(Picker(world.rays(), world.flattener()));
    });
    handle.raisePending();
    return toPython(take(std::move(found)), self);
}

py::object pick(const py::object& self, const py::object& origin, const py::object& direction, double maximum) {
    const Vec3d from = positionFrom(origin, "origin"), to = positionFrom(direction, "direction");
    return ask(self, [&](const Picker& picker) { return picker.ray(from, to, maximum); });
}

py::object nearest(const py::object& self, const py::object& point, double maximum) {
    const Vec3d at = positionFrom(point, "point");
    return ask(self, [&](const Picker& picker) { return picker.closest(at, maximum); });
}

py::object sweep(const py::object& self, const py::object& center, double radius, const py::object& displacement) {
    const Vec3d at = positionFrom(center, "center"), by = positionFrom(displacement, "displacement");
    return ask(self, [&](const Picker& picker) { return picker.sweep(at, radius, by); });
}

py::object pickPixel(const py::object& self, double x, double y, int width, int height, const std::string& viewpoint) {
    auto& handle = py::cast<SceneHandle&>(self);
    if (!(x >= 0 && y >= 0 && x < width && y < height))
        throw py::value_error(fmt::format("({}, {}) is outside a picture of {} x {}", x, y, width, height));
    return ask(self, [&](const Picker& picker) -> Result<Pick> {
        SharedWorld& world = handle.world();
        const LightTracer& tracer = handle.light().tracer();
        const auto camera = tracer.camera(world.rays(), static_cast<double>(width) / height, viewpoint);
        if (!camera) return std::unexpected(camera.error());
        const auto views = tracer.layers(world.rays(), *camera, width, height);
        if (auto ok =
                world.setViewer(EyePosition(camera->position, camera->up), LightTracer::sights(views, width, height));
            !ok)
            return std::unexpected(ok.error());
        return tracer.pick(picker, world.rays(), views, x, y);
    });
}

// ---- measured light ------------------------------------------------------------------------------------------------

/// The chordError of the level of detail whose lamps are fine enough for an error.
double chordError(double wanted) {
    int level = 0;
    const auto created = [&] { return double{Tessellator::levelOptions(level).chordError}; };
    while (level + 1 < Tessellator::kLevels && created() > wanted) ++level;
    return created();
}

py::object irradiance(SceneHandle& handle, const py::object& position, const py::object& normal, double error,
                      std::uint64_t samples, std::uint64_t seed, const std::string& shadows, unsigned threads) {
    (void)handle.between();
    const Vec3d at = positionFrom(position, "place"), facing = positionFrom(normal, "normal");
    if (!(error > 0)) throw py::value_error("an error to reach is positive");
    const double cut = std::min(.0025, error / 32);
    IrradianceSettings settings;
    settings.error = error, settings.samples = samples, settings.seed = seed, settings.threads = threads;
    settings.chordError = chordError(cut);
    settings.shadows = shadowsNamed(shadows);
    Interruption interruption;
    settings.progress = [&](std::uint64_t) { return !interruption(); };
    auto found = handle.work([&]() -> Result<Irradiance> {
        SceneHandle::Measured& measured = handle.measured(static_cast<float>(cut));
        if (auto ok = measured.world.update(); !ok) return std::unexpected(ok.error());
        return measureIrradiance(*measured.tracer.latest(), measured.world.rays(), at, facing, settings);
    });
    handle.raisePending();
    interruption.raise();
    const Irradiance result = take(std::move(found));
    if (!result.reached) warn(fmt::format("the error {:g} needs more than {} samples", error, result.samples));
    return py::module_::import("rtsg._types")
        .attr("Irradiance")(arrayOf(result.value), arrayOf(result.interval), result.luminous, result.luminousInterval,
                            result.samples, result.missing, result.reached);
}

}  // namespace

void addPictures(py::module_& module) {
    auto scene = py::class_<SceneHandle, std::shared_ptr<SceneHandle>>(module.attr("Scene"));
    scene.def("render", render,
              "A picture of the present state: an array of height x width x 3 bytes, sRGB, the top row first. Options: "
              "width=640, height=360, samples=4 (a pixel), error=0 (relative, to reach), viewpoint=\"\" (name or "
              "description), integrator=\"whitted\" or \"path\", shadows=\"auto\", \"authored\", \"all\" or \"none\", "
              "seed=1, threads=0 (one a core), panorama=False, shutter=0; format=\"rgb\", \"rgba\" (bytes), or "
              "\"linear\" (four floats, radiance premultiplied by alpha). Ctrl-C ends it.");
    scene.def(
        "render_layers", renderLayers, py::arg("layers"),
        "A picture with data of its pixels: a dict of arrays, \"rgb\" as render() makes it with the same options, "
        "and of `layers`: \"depth\" (metres along the view; infinite where nothing is), \"position\", \"normal\" "
        "(x 3, world), \"albedo\" (x 3), \"ids\" (numbers of Shape nodes, 0: none), \"motion\" (x 2, pixels). "
        "With error > 0 \"interval\" too: half the 95 % intervals.");
    scene.def("pick", pick, py::arg("origin"), py::arg("direction"), py::arg("maximum") = INFINITY,
              "The first surface that a ray meets within `maximum` metres: a Pick, or None.");
    scene.def("pick_pixel", pickPixel, py::arg("x"), py::arg("y"), py::arg("width") = 640, py::arg("height") = 360,
              py::arg("viewpoint") = "",
              "What a picture of this size shows at a place, in pixels from the left and the top.");
    scene.def("nearest", nearest, py::arg("point"), py::arg("maximum") = INFINITY,
              "The point of any surface nearest to `point`, within `maximum` metres: a Pick, or None.");
    scene.def("sweep", sweep, py::arg("center"), py::arg("radius"), py::arg("displacement"),
              "Where a ball that moves by `displacement` (metres) first touches a surface: a Pick, or None.");
    scene.def(
        "irradiance", irradiance, py::arg("place"), py::arg("normal"), py::kw_only(), py::arg("error") = .01,
        py::arg("samples") = std::uint64_t{1} << 26, py::arg("seed") = 1, py::arg("shadows") = "auto",
        py::arg("threads") = 0,
        "How much light falls on what faces `normal` at `place`, all ways of light included but the headlight: an "
        "Irradiance with 95 % intervals. pi under a light of intensity 1 head-on. `error`: half the interval over "
        "the value, to reach with at most `samples`; a warning says that it was not.");
}

}  // namespace rtsg::python
