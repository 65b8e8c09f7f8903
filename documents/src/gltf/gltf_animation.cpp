// Writes each animation as a clock, and an interpolator for each thing that it moves.
#include "gltf_animation.h"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

namespace rtsg::detail {

using nlohmann::json;

void GltfAnimations::write(std::string_view wanted) {
    for (const GltfFigure& figure : figures_)
        for (std::size_t j = 0; j < figure.joints.size(); ++j)
            joints_.emplace(figure.skin.joints()[j].node, std::pair(&figure, j));
    const json& animations = GltfFile::list(file_.root(), "animations");
    std::string playing, names;
    std::vector<std::pair<std::string, std::size_t>> clocks;
    for (std::size_t i = 0; i < animations.size(); ++i) {
        Clip clip = readTimes(animations[i], i);
        const std::string name = GltfFile::text(animations[i], "name");
        if (clip.times.empty()) continue;
        names += (names.empty() ? "" : ", ") + (name.empty() ? clip.clock : name);
        const bool isWanted = wanted.empty() || wanted == clip.clock || wanted == name;
        if (playing.empty() && isWanted) playing = clip.clock;
        writeClip(animations[i], clip);
        clocks.emplace_back(clip.clock, i);
    }
    stopEachOther(clocks);
    if (!playing.empty()) return startWithScene(playing);
    if (!wanted.empty())
        file_.fault(fmt::format("the glTF file has no clip {}{}", wanted,
                                names.empty() ? ", nor any other" : "; its clips are " + names));
}

GltfAnimations::Clip GltfAnimations::readTimes(const json& animation, std::size_t number) {
    Clip clip{.clock = names_.of(GltfNames::List::animations, number)};
    const json& samplers = GltfFile::list(animation, "samplers");
    for (const json& channel : GltfFile::list(animation, "channels")) {
        const auto sampler = GltfFile::index(channel, "sampler");
        if (!sampler || *sampler >= samplers.size() || clip.times.contains(*sampler)) continue;
        std::size_t components = 0;
        std::vector<float> keys =
            file_.floats(GltfFile::index(samplers[*sampler], "input").value_or(kNoIndex), components);
        if (keys.empty()) continue;  // which has been told
        if (components != 1 || !std::ranges::is_sorted(keys)) {
            file_.fault(fmt::format(
                "animation {} of the glTF file has keys that do not ascend in time; they are left out", number));
            continue;
        }
        clip.length = std::max(clip.length, static_cast<double>(keys.back()));
        clip.times.emplace(*sampler, std::move(keys));
    }
    // A clip whose keys are all at its beginning is a pose: it holds at any time.
    if (!(clip.length > 0)) clip.length = 1;
    return clip;
}

/// The clock waits, since its stopTime (0) is after its startTime; a later startTime sets it going.
void GltfAnimations::writeClip(const json& animation, Clip& clip) {
    {
        GltfNode sensor(out_, "TimeSensor", {}, clip.clock);
        sensor.set("cycleInterval", Time{clip.length}).set("loop", true).set("startTime", Time{-1});
        if (const std::string name = GltfFile::text(animation, "name"); !name.empty())
            sensor.set("description", String(name));
    }
    const json& channels = GltfFile::list(animation, "channels");
    const json& samplers = GltfFile::list(animation, "samplers");
    constexpr double tolerance = 1e-4;
    std::set<std::pair<std::size_t, std::string>> given;
    for (std::size_t i = 0; i < channels.size(); ++i) {
        const auto sampler = GltfFile::index(channels[i], "sampler");
        const auto node = GltfFile::index(GltfFile::object(channels[i], "target"), "node");
        const std::string path = GltfFile::text(GltfFile::object(channels[i], "target"), "path");
        if (!sampler || !node || !clip.times.contains(*sampler) || !isGiven_(*node)) continue;
        if (!given.emplace(*node, path).second) {
            file_.fault(fmt::format("{} of the glTF file moves node {} twice; the first counts", clip.clock, *node));
            continue;
        }
        const std::string def = clip.clock + "_" + std::to_string(i);
        const std::vector<float>& times = clip.times[*sampler];
        if (path == "weights") {
            writeWeights(samplers[*sampler], clip, times, def, *node);
            continue;
        }
        if (!moves(path)) {
            file_.warn(
                fmt::format("animations of the glTF file change '{}', which stays as it is", path.substr(0, 40)));
            continue;
        }
        const auto curve = readCurve(file_, samplers[*sampler], times, path == "rotation" ? 4 : 3, tolerance);
        if (!curve) continue;
        writeChannel(*curve, clip.length, path, clip.clock, def, names_.of(GltfNames::List::nodes, *node), nullptr);
        const auto [first, last] = joints_.equal_range(*node);
        for (auto at = first; at != last; ++at) {
            const auto& [figure, j] = at->second;
            writeChannel(*curve, clip.length, path, clip.clock, def + "_" + figure->joints[j], figure->joints[j],
                         &figure->skin.joints()[j]);
        }
    }
}

/// Clips that move the same node play one at a time: the start of one stops the others. The events go through a clock
/// that never runs, since routes from each clip to each other would be many.
void GltfAnimations::stopEachOther(const std::vector<std::pair<std::string, std::size_t>>& clocks) {
    const json& animations = GltfFile::list(file_.root(), "animations");
    std::map<std::pair<std::size_t, std::string>, std::size_t> mover;  // of a node's path: the first clip
    std::vector<std::size_t> first(clocks.size());
    std::iota(first.begin(), first.end(), 0);
    const auto root = [&](std::size_t i) {
        while (first[i] != i) i = first[i] = first[first[i]];
        return i;
    };
    for (std::size_t i = 0; i < clocks.size(); ++i)
        for (const json& channel : GltfFile::list(animations[clocks[i].second], "channels")) {
            const json& target = GltfFile::object(channel, "target");
            const std::size_t node = GltfFile::index(target, "node").value_or(kNoIndex);
            const auto [found, isNew] = mover.try_emplace({node, GltfFile::text(target, "path")}, i);
            if (!isNew) first[root(i)] = root(found->second);
        }
    std::map<std::size_t, std::vector<std::string>> groups;
    for (std::size_t i = 0; i < clocks.size(); ++i) groups[root(i)].push_back(clocks[i].first);
    for (const auto& [head, group] : groups) {
        if (group.size() < 2) continue;
        const std::string hub = names_.take(group.front() + "_or_others");
        GltfNode(out_, "TimeSensor", {}, hub).set("enabled", false);
        for (const std::string& clock : group) {
            out_.route(clock, "startTime", hub, "startTime", {});
            out_.route(hub, "startTime", clock, "stopTime", {});
        }
    }
}

/// A box that holds every viewer is seen from the first moment on, which is when an Inline's clip begins, too. Unlike a
/// ProximitySensor this one sends nothing while viewers move.
void GltfAnimations::startWithScene(const std::string& clock) {
    constexpr float everywhere = 1e30f;
    const std::string def = names_.take(clock + "_start");
    GltfNode(out_, "VisibilitySensor", {}, def).set("size", Vec3f(everywhere));
    out_.route(def, "enterTime", clock, "startTime", {});
}

void GltfAnimations::writeChannel(const GltfCurve& curve, double length, const std::string& path,
                                  const std::string& clock, const std::string& wanted, const std::string& target,
                                  const GltfSkin::Joint* joint) {
    if (!file_.mayMake(sizeof(float) * (1 + curve.size) * curve.times.size())) return;
    const bool rounds = path == "rotation";
    Array<float> keys;
    Array<Rotation> rotations;
    Array<Vec3f> positions;
    for (std::size_t i = 0; i < curve.times.size(); ++i) {
        keys.push_back(static_cast<float>(curve.times[i] / length));
        const double* v = curve.at(i);
        if (rounds && joint) {
            rotations.push_back(joint->rotation(glm::normalize(glm::dquat(v[3], v[0], v[1], v[2]))));
        } else if (rounds) {
            rotations.push_back(rotationOf(v));
        } else {
            const glm::dvec3 value(v[0], v[1], v[2]);
            positions.push_back(!joint            ? Vec3f(value)
                                : path == "scale" ? joint->scale(value)
                                                  : joint->translation(value));
        }
    }
    const std::string def = names_.take(wanted);
    {
        GltfNode out(out_, rounds ? "OrientationInterpolator" : "PositionInterpolator", {}, def);
        out.set("key", std::move(keys));
        if (rounds)
            out.set("keyValue", std::move(rotations));
        else
            out.set("keyValue", std::move(positions));
    }
    out_.route(clock, "fraction_changed", def, "set_fraction", {});
    out_.route(def, "value_changed", target, path, {});
}

void GltfAnimations::writeWeights(const json& sampler, const Clip& clip, const std::vector<float>& times,
                                  const std::string& def, std::size_t nodeIndex) {
    const json* node = file_.item("nodes", nodeIndex);
    const json* mesh = node ? file_.item("meshes", GltfFile::index(*node, "mesh").value_or(kNoIndex)) : nullptr;
    if (!mesh)
        return file_.fault(
            fmt::format("weights of node {} of the glTF file are animated, and it has no mesh", nodeIndex));
    constexpr double tolerance = 1e-3;  // each key holds all points
    const auto curve = readCurve(file_, sampler, times, 0, tolerance);
    if (!curve) return;
    std::size_t part = 0;
    for (const json& primitive : GltfFile::list(*mesh, "primitives")) {
        constexpr std::uint64_t bytes = 256;  // of its nodes
        if (!file_.mayMake(bytes)) return;
        if (curve->size != GltfFile::list(primitive, "targets").size())
            return file_.fault(def + ": an animation of the glTF file has another number of weights than targets");
        const std::string name = names_.take(def + "_part" + std::to_string(part));
        const std::string& points = names_.points(nodeIndex, part++);
        const Array<Vec3f> rest = meshes_.vectors(GltfFile::object(primitive, "attributes"), "POSITION", 0);
        constexpr std::size_t maximum = std::size_t{1} << 26;  // points in all keys
        if (!meshes_.hasPoints(points)) continue;              // the primitive was left out
        if (rest.empty() || rest.size() > maximum / curve->times.size()) {
            file_.fault("animated weights of the glTF file move too many points; they rest");
            continue;
        }
        if (!file_.mayMake(sizeof(Vec3f) * rest.size() * curve->times.size())) return;
        Array<float> keys;
        Array<Vec3f> values;
        for (std::size_t i = 0; i < curve->times.size(); ++i) {
            Array<Vec3f> form = rest;
            meshes_.morph(primitive, "POSITION", std::vector<double>(curve->at(i), curve->at(i) + curve->size), form);
            keys.push_back(static_cast<float>(curve->times[i] / clip.length));
            values.append({form.data(), form.size()});
        }
        GltfNode(out_, "CoordinateInterpolator", {}, name)
            .set("key", std::move(keys))
            .set("keyValue", std::move(values));
        out_.route(clip.clock, "fraction_changed", name, "set_fraction", {});
        out_.route(name, "value_changed", points, "point", {});
    }
}

}  // namespace rtsg::detail
