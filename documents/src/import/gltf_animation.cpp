// Writes each animation as a clock, and an interpolator for each thing that it moves.
#include "gltf_animation.h"

#include <algorithm>

namespace rtsg::detail {

using nlohmann::json;

void GltfAnimations::write(const json& animation, std::size_t number) {
    const json& channels = GltfFile::list(animation, "channels");
    const json& samplers = GltfFile::list(animation, "samplers");
    double length = 0;
    std::map<std::size_t, std::vector<float>> times;
    for (const json& channel : channels) {
        const auto sampler = GltfFile::index(channel, "sampler");
        if (!sampler || *sampler >= samplers.size() || times.contains(*sampler)) continue;
        std::size_t components = 0;
        std::vector<float> keys =
            file_.floats(GltfFile::index(samplers[*sampler], "input").value_or(kNoIndex), components);
        if (components != 1 || keys.empty()) continue;
        length = std::max(length, static_cast<double>(keys.back()));
        times.emplace(*sampler, std::move(keys));
    }
    if (times.empty() || !(length > 0)) return;
    const std::string clock = "animation" + std::to_string(number);
    {
        GltfNode sensor(out_, "TimeSensor", {}, clock);
        sensor.set("cycleInterval", Time{length}).set("loop", true);
        if (const std::string name = GltfFile::text(animation, "name"); !name.empty())
            sensor.set("description", String(name));
    }
    for (std::size_t i = 0; i < channels.size(); ++i) {
        const auto sampler = GltfFile::index(channels[i], "sampler");
        const auto node = GltfFile::index(GltfFile::object(channels[i], "target"), "node");
        const std::string path = GltfFile::text(GltfFile::object(channels[i], "target"), "path");
        if (!sampler || !node || !times.contains(*sampler)) continue;
        const std::string def = clock + "_" + std::to_string(i);
        if (!isGiven_(*node)) continue;
        if (path == "weights") {
            writeWeights(samplers[*sampler], times[*sampler], length, clock, def, *node);
            continue;
        }
        writeChannel(samplers[*sampler], times[*sampler], length, path, clock, def, defOfGltfNode(*node), nullptr);
        for (const GltfFigure& figure : figures_)
            for (std::size_t j = 0; j < figure.skin.joints().size(); ++j)
                if (figure.skin.joints()[j].node == *node)
                    writeChannel(samplers[*sampler], times[*sampler], length, path, clock, def + "_" + figure.joint(j),
                                 figure.joint(j), &figure.skin.joints()[j]);
    }
}

void GltfAnimations::writeChannel(const json& sampler, const std::vector<float>& times, double length,
                                  const std::string& path, const std::string& clock, const std::string& def,
                                  const std::string& target, const GltfSkin::Joint* joint) {
    const std::string how = GltfFile::text(sampler, "interpolation");
    std::size_t size = 0;
    const std::vector<float> numbers = file_.floats(GltfFile::index(sampler, "output").value_or(kNoIndex), size);
    const bool turns = path == "rotation", cubic = how == "CUBICSPLINE", step = how == "STEP";
    if (cubic) file_.warn("splines of the glTF file's animations are played as lines through their keys");
    // A spline has two tangents beside each value.
    const std::size_t each = cubic ? 3 : 1, first = cubic ? 1 : 0;
    if (size != (turns ? 4u : 3u) || numbers.size() != times.size() * each * size)
        return file_.warn("an animation of the glTF file has another number of values than keys; it is left out");
    Array<float> keys;
    Array<Rotation> rotations;
    Array<Vec3f> places;
    const auto add = [&](double key, std::size_t i) {
        keys.push_back(static_cast<float>(key));
        const float* v = numbers.data() + (i * each + first) * size;
        if (turns && joint) {
            rotations.push_back(joint->rotation(glm::normalize(glm::dquat(v[3], v[0], v[1], v[2]))));
        } else if (turns) {
            const double q[4] = {v[0], v[1], v[2], v[3]};
            rotations.push_back(rotationOf(q));
        } else if (joint) {
            const glm::dvec3 value(v[0], v[1], v[2]);
            places.push_back(path == "scale" ? joint->scale(value) : joint->translation(value));
        } else {
            places.push_back({v[0], v[1], v[2]});
        }
    };
    for (std::size_t i = 0; i < times.size(); ++i) {
        const double key = static_cast<double>(times[i]) / length;
        if (step && i > 0) add(key, i - 1);
        add(key, i);
    }
    {
        GltfNode out(out_, turns ? "OrientationInterpolator" : "PositionInterpolator", {}, def);
        out.set("key", std::move(keys));
        if (turns)
            out.set("keyValue", std::move(rotations));
        else
            out.set("keyValue", std::move(places));
    }
    out_.route(clock, "fraction_changed", def, "set_fraction", {});
    out_.route(def, "value_changed", target, path, {});
}

void GltfAnimations::writeWeights(const json& sampler, const std::vector<float>& times, double length,
                                  const std::string& clock, const std::string& def, std::size_t nodeIndex) {
    const json* node = file_.item("nodes", nodeIndex);
    const json* mesh = node ? file_.item("meshes", GltfFile::index(*node, "mesh").value_or(kNoIndex)) : nullptr;
    if (!mesh) return;
    std::size_t size = 0;
    const std::vector<float> numbers = file_.floats(GltfFile::index(sampler, "output").value_or(kNoIndex), size);
    const std::string how = GltfFile::text(sampler, "interpolation");
    const bool cubic = how == "CUBICSPLINE", step = how == "STEP";
    const std::size_t each = cubic ? 3 : 1, groups = times.size() * each;
    if (size != 1 || numbers.empty() || numbers.size() % groups != 0)
        return file_.warn("an animation of the glTF file has another number of values than keys; it is left out");
    if (cubic) file_.warn("splines of the glTF file's animations are played as lines through their keys");
    const std::size_t targets = numbers.size() / groups;
    std::size_t part = 0;
    for (const json& primitive : GltfFile::list(*mesh, "primitives")) {
        const std::string name = def + "_part" + std::to_string(part);
        const std::string points = defOfGltfPoints(nodeIndex, part++);
        const Array<Vec3f> rest = meshes_.vectors(GltfFile::object(primitive, "attributes"), "POSITION", 0);
        constexpr std::size_t most = std::size_t{1} << 26;  // points in all keys
        if (rest.empty() || rest.size() > most / (2 * times.size())) {
            file_.warn("animated weights of the glTF file move too many points; they rest");
            continue;
        }
        Array<float> keys;
        Array<Vec3f> values;
        const auto add = [&](double key, std::size_t i) {
            const float* first = numbers.data() + (i * each + (cubic ? 1 : 0)) * targets;
            Array<Vec3f> form = rest;
            meshes_.morph(primitive, "POSITION", std::vector<double>(first, first + targets), form);
            keys.push_back(static_cast<float>(key));
            values.append({form.data(), form.size()});
        };
        for (std::size_t i = 0; i < times.size(); ++i) {
            const double key = static_cast<double>(times[i]) / length;
            if (step && i > 0) add(key, i - 1);
            add(key, i);
        }
        GltfNode(out_, "CoordinateInterpolator", {}, name)
            .set("key", std::move(keys))
            .set("keyValue", std::move(values));
        out_.route(clock, "fraction_changed", name, "set_fraction", {});
        out_.route(name, "value_changed", points, "point", {});
    }
}

}  // namespace rtsg::detail
