// Reads the sound nodes of a scene, and follows their changes.
#include <rtsg/audio/sound_scene.h>
#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include <fmt/format.h>

#include <rtsg/audio/material_table.h>
#include <rtsg/core/navigation.h>
#include <rtsg/core/x3d.h>
#include <rtsg/renderers/camera.h>

#include "sound_fields.h"
#include "walls/walls.h"

namespace rtsg {
namespace {

/// The coordinate of things without a place: out of hearing, but a number (metres).
constexpr double kNowhere = 1e12;

double fractionOf(double value) {
    return std::isfinite(value) ? std::clamp(value, 0.0, 1.0) : 0.0;
}

/// Reads octave bands from a metadata node called `name`; false if there are none. `tell`: reports invalid ones.
bool bandsFromMetadata(const Scene& scene, NodeId id, std::string_view name, Bands& bands, const ReportMaterial& report,
                       int depth = 0) {
    const Node* node = scene.find(id);
    if (!node || depth > 8) return false;
    std::vector<double> values;
    if (node->is(x3d::MetadataSet::type)) {
        for (const NodeId child : node->get(x3d::MetadataSet::value))
            if (bandsFromMetadata(scene, child, name, bands, report, depth + 1)) return true;
        return false;
    }
    if (node->is(x3d::MetadataFloat::type) && node->get(x3d::MetadataFloat::name).view() == name) {
        for (const float value : node->get(x3d::MetadataFloat::value)) values.push_back(static_cast<double>(value));
    } else if (node->is(x3d::MetadataDouble::type) && node->get(x3d::MetadataDouble::name).view() == name) {
        for (const double value : node->get(x3d::MetadataDouble::value)) values.push_back(value);
    } else {
        return false;
    }
    if (values.size() < 6 || values.size() > kBandCount) {
        if (report)
            report(id,
                   fmt::format("{} of the metadata has {} value{}, and octave bands are 10 or 9 (from 31.5 Hz on), 8 "
                               "(from 63 Hz) or 7 or 6 (from 125 Hz): the field counts",
                               name, values.size(), values.size() == 1 ? "" : "s"));
        return false;
    }
    const auto wrong = std::ranges::find_if(values, [](double value) { return !(value >= 0 && value <= 1); });
    if (report && wrong != values.end())
        report(id, fmt::format("{} of the metadata has the value {:g}, outside 0 to 1: {:g} counts", name, *wrong,
                               fractionOf(*wrong)));
    const int count = static_cast<int>(values.size());
    // From 31.5 Hz, from 63 Hz, or from 125 Hz.
    const int first = count >= 9 ? 0 : count == 8 ? 1 : 2;
    for (int b = 0; b < kBandCount; ++b) {
        const int index = std::clamp(b - first, 0, count - 1);
        bands[static_cast<std::size_t>(b)] = values[static_cast<std::size_t>(index)];
    }
    return true;
}

/// The value of a MetadataString "acousticMaterial" in a node's metadata; empty without one.
std::string_view askedIn(const Scene& scene, NodeId metadata, int depth = 0) {
    constexpr int kDeepest = 8;
    const Node* node = scene.find(metadata);
    if (!node || depth > kDeepest) return {};
    if (node->is(x3d::MetadataSet::type)) {
        for (const NodeId child : node->get(x3d::MetadataSet::value))
            if (const std::string_view name = askedIn(scene, child, depth + 1); !name.empty()) return name;
        return {};
    }
    if (!node->is(x3d::MetadataString::type) || node->get(x3d::MetadataString::name).view() != "acousticMaterial")
        return {};
    const auto& values = node->get(x3d::MetadataString::value);
    return values.empty() ? std::string_view() : values[0].view();
}

std::string_view askedMaterial(const Scene& scene, const Node& node) {
    return askedIn(scene, fieldOr(node, "metadata", NodeId{}));
}

/// The position and axes of a listener, as far as they are finite: a Camera has others to use instead.
struct FoundPose {
    ListenerPose pose;
    bool isSomewhere, isTurned;
};

FoundPose poseFrom(const WorldFromLocal& m, const Vec3d& position, const Rotation& orientation) {
    const Camera camera = Camera::perspective(m, position, orientation, 0.785, 1);
    const glm::dmat3 axes = camera.axes();
    FoundPose found;
    found.pose.position = camera.position;
    found.pose.right = axes[0];
    found.pose.up = axes[1];
    found.pose.back = axes[2];
    found.isSomewhere = !camera.nowhere;
    const glm::dvec3 rotation = m[0] + m[1] + m[2] + glm::dvec3(orientation.x, orientation.y, orientation.z);
    found.isTurned = std::isfinite(rotation.x + rotation.y + rotation.z + double{orientation.angle});
    return found;
}

}  // namespace

AcousticMaterial acousticMaterial(const Scene& scene, const Node& node, const AcousticMaterial& defaults,
                                  const ReportMaterial& report) {
    using P = x3d::AcousticProperties;
    if (!node.get(P::enabled)) return defaults;
    Bands absorption = allBands(static_cast<double>(node.get(P::absorption)));
    Bands diffuse = allBands(static_cast<double>(node.get(P::diffuse)));
    Bands specular = allBands(static_cast<double>(node.get(P::specular)));
    Bands refraction = allBands(static_cast<double>(node.get(P::refraction)));
    const NodeId metadata = node.get(P::metadata);
    bandsFromMetadata(scene, metadata, "absorption", absorption, report);
    bandsFromMetadata(scene, metadata, "diffuse", diffuse, report);
    bandsFromMetadata(scene, metadata, "specular", specular, report);
    bandsFromMetadata(scene, metadata, "refraction", refraction, report);
    AcousticMaterial material;
    for (std::size_t b = 0; b < kBandCount; ++b) {
        const double a = fractionOf(absorption[b]), through = std::min(fractionOf(refraction[b]), 1 - a);
        const double left = 1 - a - through, d = fractionOf(diffuse[b]), s = fractionOf(specular[b]);
        material.absorption[b] = a;
        material.transmission[b] = through;
        // Fields are in single precision: where diffuse is all that is left, rounding leaves no mirror.
        constexpr double kRounding = 1e-6;
        const double scattered = s > 0 ? d / (d + s) : left > 0 ? d / left : 0;
        material.scattering[b] = scattered > 1 - kRounding ? 1 : scattered;
    }
    return material;
}

bool SoundTimes::active(double t) const {
    if (t < startTime || (stopTime > startTime && t >= stopTime)) return false;
    if (pauseTime < startTime || t < pauseTime) return true;
    // 8.2.4.4: what resumes after its pause had to be paused by then, or it never was.
    if (resumeTime > pauseTime) return t >= resumeTime || (!paused && pausedTotal == 0);
    return pauseTime == resumeTime;
}

double SoundNode::level(const glm::dvec3& listener) const {
    const glm::dvec3 to = listener - location;
    const double distance = glm::length(to);
    if (law == Law::none) return 1;
    if (law != Law::ellipsoids) {
        const double reference = std::max(1e-6, referenceDistance);
        if (law == Law::linear) {
            // Web Audio API, PannerNode: the two distances in order, and where they are one all is beyond them.
            const double near = std::min(reference, maxDistance), far = std::max(reference, maxDistance);
            const double part = far > near ? (std::clamp(distance, near, far) - near) / (far - near) : 1;
            return 1 - std::clamp(rolloff, 0.0, 1.0) * part;
        }
        if (law == Law::inverse)
            return reference / (reference + std::max(0.0, rolloff) * (std::max(distance, reference) - reference));
        return std::pow(std::max(distance, reference) / reference, -std::max(0.0, rolloff));
    }
    const double axis = glm::length(direction);
    const double cosine = distance > 0 && axis > 0 ? glm::dot(to, direction) / (distance * axis) : 1;
    // An ellipsoid with a focus at the origin: radius f b / mean at a right angle, f ahead, b behind.
    const auto radius = [&](double front, double back) {
        front = std::max(0.0, front), back = std::max(0.0, back);
        const double denominator = front + back - (front - back) * cosine;
        return denominator > 0 ? 2 * front * back / denominator : std::max(front, back);
    };
    const double inner = radius(minFront, minBack);
    const double outer = std::max(inner, radius(maxFront, maxBack));
    if (distance <= inner) return 1;
    if (distance >= outer) return 0;
    return std::pow(10.0, -(distance - inner) / (outer - inner));
}

double SoundNode::coneGain(const glm::dvec3& listener) const {
    if (law == Law::ellipsoids || (coneInner >= 6.2831 && coneOuter >= 6.2831)) return 1;
    const glm::dvec3 to = listener - location;
    const double length = glm::length(to) * glm::length(direction);
    if (!(length > 0)) return 1;
    const double angle = std::acos(std::clamp(glm::dot(to, direction) / length, -1.0, 1.0));
    const double inner = coneInner / 2, outer = std::max(inner, coneOuter / 2);
    if (angle <= inner) return 1;
    if (angle >= outer) return coneOuterGain;
    return 1 + (coneOuterGain - 1) * (angle - inner) / (outer - inner);
}

bool SoundNode::directional(bool levels) const {
    if (law == Law::none) return false;
    if (law == Law::ellipsoids) return levels && (minFront != minBack || maxFront != maxBack);
    return (coneInner < 6.2831 || coneOuter < 6.2831) && coneOuterGain != 1;
}

namespace {

/// The first emitter in this slot or a later one.
template <class Emitters>
auto emitterFrom(Emitters& emitters, std::uint32_t slot) {
    return std::lower_bound(emitters.begin(), emitters.end(), slot,
                            [](const SoundEmitter& e, std::uint32_t s) { return e.id.slot < s; });
}

}  // namespace

glm::dvec3 SoundEmitter::aim() const {
    const glm::dvec3 displacement =
        glm::dmat3(worldFromLocal[0], worldFromLocal[1], worldFromLocal[2]) * sound->direction;
    const double length = glm::length(displacement);
    return length > 0 && std::isfinite(length) ? displacement / length : glm::dvec3(0);
}

glm::dvec3 SoundEmitter::position() const {
    const glm::dvec3 p = worldFromLocal * glm::dvec4(sound->location, 1.0);
    return std::isfinite(p.x + p.y + p.z) ? p : glm::dvec3(kNowhere);
}

glm::dvec3 SoundEmitter::localFrom(const glm::dvec3& offset) const {
    const glm::dmat3 linear(worldFromLocal[0], worldFromLocal[1], worldFromLocal[2]);
    return sound->location + (std::abs(glm::determinant(linear)) > 1e-12 ? glm::inverse(linear) * offset : offset);
}

const SoundEmitter* SoundVersion::find(InstanceId id) const {
    const auto it = emitterFrom(*emitters, id.slot);
    return it != emitters->end() && it->id == id ? &*it : nullptr;
}

SoundScene::SoundScene(Walls* walls, const AcousticMaterial& defaults, Resources resources, bool keepsStreams,
                       std::shared_ptr<const MaterialTable> materials)
    : walls_(walls),
      defaults_(defaults),
      resources_(std::move(resources)),
      keepsStreams_(keepsStreams),
      materials_(std::move(materials)) {}

std::string_view SoundScene::materialName(const Scene& scene, NodeId id) const {
    const Node* node = scene.effectiveNode(id);
    if (!node) return {};
    // An instance of a prototype has a name of its own.
    for (const std::string_view name : {askedMaterial(scene, *node), scene.name(id), scene.name(node->id())})
        if (materials_->find(name)) return name;
    return {};
}

NodeId SoundScene::materialNode(const Scene& scene, const Instance& instance) const {
    if (!materials_) return instance.acoustics;
    NodeId asking;  // for nodes that do not exist
    const Node* appearance = scene.find(instance.appearance);
    const bool whole = appearance && appearance->is(x3d::Appearance::type);
    for (const NodeId id :
         {instance.acoustics, instance.appearance, whole ? appearance->get(x3d::Appearance::material) : NodeId{}}) {
        const Node* node = scene.effectiveNode(id);
        if (!node) continue;
        if (!materialName(scene, id).empty()) return id;
        if (!asking && !askedMaterial(scene, *node).empty()) asking = id;
    }
    return instance.acoustics || !asking ? instance.acoustics : asking;
}

std::vector<std::string> SoundScene::unusedMaterials() const {
    std::vector<std::string> names;
    if (materials_)
        for (const auto& [name, row] : materials_->rows())
            if (!usedMaterials_.contains(name)) names.push_back(name);
    return names;
}

std::vector<std::filesystem::path> SoundScene::foldersOf(const Scene& scene, const Node& node) const {
    return resources_.foldersOf(scene, node, node.type().findExact("url"));
}

std::vector<SoundEmitter>& SoundScene::ownEmitters() {
    if (shared_) emitters_ = std::make_shared<std::vector<SoundEmitter>>(*emitters_);
    shared_ = false;
    return *emitters_;
}

SoundVersion SoundScene::freeze() {
    shared_ = true;
    return {emitters_, listener_, air_};
}

namespace {

FoundPose foundPose(const Scene& scene, const Placed& placed) {
    const Node& node = scene.node(placed.node);
    if (const auto moved = movedView(node))
        return poseFrom(placed.worldFromLocal, moved->position, orientationOf(*moved));
    if (node.is(x3d::GeoViewpoint::type))  // is where its coordinates are
        return poseFrom(placed.worldFromLocal, Vec3d(0), node.get(x3d::GeoViewpoint::orientation));
    return poseFrom(placed.worldFromLocal, Vec3d(fieldOr(node, "position", Vec3f(0, 0, 10))),
                    fieldOr(node, "orientation", Rotation{}));
}

}  // namespace

/// Parts of the pose that are not finite keep their last finite values, or X3D's defaults.
ListenerPose SoundScene::poseOf(const Scene& scene, const Placed& placed) {
    const auto [now, isSomewhere, isTurned] = foundPose(scene, placed);
    ListenerPose& pose = poses_[placed.id.slot];
    const auto report = [&](std::string_view text) {
        warnOnce(scene.locationOf(placed.node),
                 fmt::format("{}: its {}", nameOf(scene, scene.node(placed.node)), text));
    };
    if (isSomewhere)
        pose.position = now.position;
    else
        report("position in the world is no place: the last that was one counts, or 0 0 10");
    if (isTurned)
        pose.right = now.right, pose.up = now.up, pose.back = now.back;
    else
        report("orientation in the world is no rotation: the last that was one counts, or 0 0 1 0");
    return pose;
}

/// The distance of the ears if it is that of a head, or of microphones; 0 if it is not given.
double SoundScene::earDistance(const Scene& scene, const Node& node) {
    constexpr double kMax = 0.5;
    const double reported = std::max(0.0, numbersIn(scene, node).any("interauralDistance", 0, 0));
    if (reported > kMax)
        warnOnce(scene.locationOf(node.id()),
                 fmt::format("{}: its interauralDistance is too large: {:g} m count", nameOf(scene, node), kMax));
    return std::min(reported, kMax);
}

void SoundScene::findPositions(const Scene& scene) {
    std::map<std::uint32_t, const Placed*> listeners, views;  // by slot
    for (const auto& [slot, placed] : others_) {
        const Node* node = scene.find(placed.node);
        if (!node) continue;
        if (placed.kind == PlacedKind::view)
            views[slot] = &placed;
        else if (fieldOr(*node, "enabled", true) && !fieldOr(*node, "trackCurrentView", false))
            listeners[slot] = &placed;
    }
    const auto& chosen = listeners.empty() ? views : listeners;
    std::map<std::string, int> named, seen;
    for (const auto& [slot, placed] : chosen) ++named[nameOf(scene, scene.node(placed->node))];
    positions_.clear();
    for (const auto& [slot, placed] : chosen) {
        std::string name = nameOf(scene, scene.node(placed->node));
        if (named[name] > 1) name += fmt::format(" {}", ++seen[name]);
        const ListenerPose pose = poseOf(scene, *placed);
        positions_.push_back({std::move(name), pose.position, glm::dmat3(pose.right, pose.up, pose.back)});
        ListenerPose head;
        head.earDistance = earDistance(scene, scene.node(placed->node));
        positions_.back().headRadius = head.headRadius();
    }
    if (positions_.empty()) positions_.push_back({"listener", listener_.position, {}});
}

void SoundScene::chooseListener(const Scene& scene) {
    const Placed* listener = nullptr;
    const Placed* view = nullptr;
    NodeId bound;
    if (const Node* root = scene.find(scene.root())) {
        const Node* layer = scene.find(root->get(x3d::RtsgScene::_activeLayer));
        const Node& holder = layer ? *layer : *root;
        const FieldIndex field = holder.type().findExact("_viewpointStack");
        if (field != kNoField)
            if (const auto& stack = holder.get(Field<Array<NodeId>>{field}); !stack.empty()) bound = stack[0];
    }
    for (const auto& [slot, placed] : others_) {
        const Node* node = scene.find(placed.node);
        if (!node) continue;
        if (placed.kind == PlacedKind::listener) {
            if (fieldOr(*node, "enabled", true) && (!listener || placed.id.slot < listener->id.slot))
                listener = &placed;
        } else if (!view || (placed.node == bound) > (view->node == bound) ||
                   ((placed.node == bound) == (view->node == bound) && placed.id.slot < view->id.slot)) {
            view = &placed;
        }
    }
    listener_ = view ? poseOf(scene, *view) : ListenerPose{};
    if (!listener) return;
    const Node& node = scene.node(listener->node);
    if (!fieldOr(node, "trackCurrentView", false)) listener_ = poseOf(scene, *listener);
    const FieldNumbers in = numbersIn(scene, node);
    listener_.gain = in.any("gain", 0, 1);
    listener_.doppler = fieldOr(node, "dopplerEnabled", false);
    listener_.earDistance = earDistance(scene, node);
}

void SoundScene::readMaterial(const Scene& scene, NodeId id) {
    const Node* node = scene.effectiveNode(id);
    if (node && materials_) {
        if (const std::string_view asked = askedMaterial(scene, *node); !asked.empty() && !materials_->find(asked))
            warnOnce(scene.locationOf(id),
                     fmt::format("{}: the table of materials has no '{}'", nameOf(scene, *node), asked));
        if (const std::string_view name = materialName(scene, id); !name.empty()) {
            usedMaterials_.emplace(name);
            return walls_->setMaterial(id, *materials_->find(name));
        }
    }
    const bool says = node && node->is(x3d::AcousticProperties::type);
    const auto report = [&](NodeId metadata, std::string text) {
        warnOnce(scene.locationOf(metadata), fmt::format("{}: {}", nameOf(scene, *node), text));
    };
    walls_->setMaterial(id, says ? acousticMaterial(scene, *node, defaults_, report) : defaults_);
}

void SoundScene::readWalls(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    if (!walls_) return;
    // In a scene that starts over, other nodes have the same numbers.
    if (changes.isSnapshot()) acousticsKnown_.clear();
    // Known from before or not: while nothing had it nobody told of its changes.
    std::unordered_set<std::uint32_t> now;
    for (const auto* list : {&delta.added, &delta.rebound})
        for (const Instance& instance : *list)
            if (const NodeId id = materialNode(scene, instance); id && now.insert(id.value).second)
                readMaterial(scene, id);
    for (const NodeId id : delta.acousticsChanged)
        if (acousticsKnown_.contains(id.value) && !now.contains(id.value)) readMaterial(scene, id);
    acousticsKnown_.merge(now);
}

/// Whether there are others than before.
bool SoundScene::moveEmitters(const Scene& scene, const InstanceDelta& delta) {
    bool others = false;
    const auto emitterAt = [&](InstanceId id) -> SoundEmitter* {
        const auto it = emitterFrom(*emitters_, id.slot);
        if (it == emitters_->end() || it->id != id) return nullptr;
        auto& own = ownEmitters();
        return &*emitterFrom(own, id.slot);
    };
    for (const InstanceId id : delta.placedRemoved)
        if (const SoundEmitter* emitter = emitterAt(id)) {
            emitters_->erase(emitters_->begin() + (emitter - emitters_->data()));
            others = true;
        }
    // In a scene that starts over the same number may be another node, so nodes that come are read anew.
    std::unordered_set<std::uint32_t> read;
    std::unordered_map<const SoundNode*, std::shared_ptr<const SoundNode>> replaced;
    for (const auto* list : {&delta.placedAdded, &delta.placedRebound})
        for (const Placed& placed : *list) {
            if (placed.kind != PlacedKind::sound) continue;
            const Node* node = scene.find(placed.node);
            if (!node || (!node->is(x3d::Sound::type) && !node->is(x3d::SpatialSound::type) &&
                          !node->is(x3d::AudioDestination::type) && !node->is(x3d::StreamAudioDestination::type)))
                continue;
            auto& sound = sounds_[placed.node.value];
            if (read.insert(placed.node.value).second) {
                const auto before = std::exchange(sound, readSound(scene, *node));
                if (before) replaced[before.get()] = sound;
            }
            SoundEmitter fresh{placed.id, sound, placed.worldFromLocal, {}};
            if (SoundEmitter* emitter = emitterAt(placed.id)) {
                *emitter = std::move(fresh);
            } else {
                auto& own = ownEmitters();
                own.insert(emitterFrom(own, placed.id.slot), std::move(fresh));
            }
            others = true;
        }
    if (!replaced.empty())
        for (SoundEmitter& emitter : ownEmitters())
            if (const auto it = replaced.find(emitter.sound.get()); it != replaced.end()) emitter.sound = it->second;
    for (const InstanceDelta::Moved& moved : delta.placedMoved)
        if (SoundEmitter* emitter = emitterAt(moved.id)) emitter->worldFromLocal = moved.worldFromLocal;
    for (const NodeId id : delta.placedChanged) {
        const auto it = sounds_.find(id.value);
        const Node* node = it != sounds_.end() ? scene.find(id) : nullptr;
        if (!node) continue;
        const auto before = std::exchange(it->second, readSound(scene, *node));
        for (SoundEmitter& emitter : ownEmitters())
            if (emitter.sound == before) emitter.sound = it->second;
    }
    return others;
}

void SoundScene::nameEmitters() {
    std::unordered_map<std::uint32_t, int> total, seen;
    for (const SoundEmitter& e : *emitters_) ++total[e.sound->node.value];
    for (SoundEmitter& e : ownEmitters()) {
        const std::uint32_t node = e.sound->node.value;
        e.name = total[node] > 1 ? fmt::format("{}[{}]", e.sound->name, seen[node]++) : e.sound->name;
    }
    std::erase_if(sounds_, [&](const auto& entry) { return !total.contains(entry.first); });
}

void SoundScene::warnOnce(const NodeLocation& location, std::string text) {
    // This many texts of a scene that keeps making new names are remembered; further ones are not reported.
    constexpr std::size_t kMax = 1000;
    if (reported_.size() < kMax && reported_.insert(text).second) diagnostics_.warningAt(location, std::move(text));
}

/// Names sounds that lead to a stream, since nobody hears them here.
void SoundScene::nameSilent(const Scene& scene, const ChangeSet& changes) {
    if (keepsStreams_) return;
    for (const Change& change : changes.changes) {
        if (change.kind == ChangeKind::defineType) continue;
        if (change.kind != ChangeKind::createNode) return;  // these come first
        const TypeIndex type{static_cast<std::uint16_t>(change.index)};
        if (type != x3d::StreamAudioDestination::type) continue;
        if (const Node* node = scene.find(change.node))
            warnOnce(scene.locationOf(node->id()),
                     fmt::format("{} {} is heard by nobody: rtsg listen --stream-out writes it to a file",
                                 node->type().name, nameOf(scene, *node)));
    }
}

namespace {

/// A number or a truth in a metadata node called `name`.
std::optional<double> numberFromMetadata(const Scene& scene, NodeId id, std::string_view name, int depth = 0) {
    const Node* node = scene.find(id);
    if (!node || depth > 8) return std::nullopt;
    if (node->is(x3d::MetadataSet::type)) {
        for (const NodeId child : node->get(x3d::MetadataSet::value))
            if (const auto found = numberFromMetadata(scene, child, name, depth + 1)) return found;
        return std::nullopt;
    }
    const auto first = [&]<class N>() -> std::optional<double> {
        if (!node->is(N::type) || node->get(N::name).view() != name || node->get(N::value).empty()) return std::nullopt;
        const auto value = static_cast<double>(node->get(N::value)[0]);
        return std::isfinite(value) ? std::optional(value) : std::nullopt;
    };
    for (const auto& found :
         {first.template operator()<x3d::MetadataFloat>(), first.template operator()<x3d::MetadataDouble>(),
          first.template operator()<x3d::MetadataBoolean>(), first.template operator()<x3d::MetadataInteger>()})
        if (found) return found;
    return std::nullopt;
}

}  // namespace

/// Reads the first WorldInfo that gives them: airTemperature (degrees Celsius), airHumidity (percent), airPressure
/// (kPa), speedOfSound (m/s), airAbsorption (a boolean).
void SoundScene::readAir(const Scene& scene, const ChangeSet& changes) {
    bool touched = false;
    for (const Change& change : changes.changes) {
        if (change.kind == ChangeKind::createNode) {
            if (TypeIndex{static_cast<std::uint16_t>(change.index)} == x3d::WorldInfo::type)
                touched = infos_.insert(change.node.value).second || touched;
        } else if (change.kind == ChangeKind::destroyNode) {
            touched = infos_.erase(change.node.value) > 0 || touched;
        } else if (!infos_.empty() && change.kind == ChangeKind::setField) {
            const Node* node = scene.find(change.node);
            touched = touched || (node && (node->is(x3d::WorldInfo::type) || node->type().isA("X3DMetadataObject")));
        }
    }
    if (!touched) return;
    air_ = {};
    std::vector<std::uint32_t> infos(infos_.begin(), infos_.end());
    std::sort(infos.begin(), infos.end());
    for (const std::uint32_t info : infos) {
        const Node* node = scene.find(NodeId{info});
        if (!node) continue;
        const NodeId metadata = node->get(x3d::WorldInfo::metadata);
        const auto read = [&](std::string_view name, double low, double high, std::optional<double>& into) {
            if (into) return;
            into = numberFromMetadata(scene, metadata, name);
            if (!into || (*into >= low && *into <= high)) return;
            warnOnce(
                scene.locationOf(metadata),
                fmt::format("{} of the metadata is {:.6g}; it counts from {:g} to {:g} only", name, *into, low, high));
            into.reset();
        };
        read("airTemperature", -50, 60, air_.celsius);
        read("airHumidity", 0, 100, air_.relativeHumidity);
        read("airPressure", 10, 200, air_.pressureKpa);
        read("speedOfSound", 10, 10'000, air_.speedOfSound);
        std::optional<double> absorbs;
        read("airAbsorption", 0, 1, absorbs);
        if (absorbs && !air_.absorbs) air_.absorbs = *absorbs != 0;
    }
}

void SoundScene::apply(const Scene& scene, const ChangeSet& changes, const InstanceDelta& delta) {
    nameSilent(scene, changes);
    readAir(scene, changes);
    readWalls(scene, changes, delta);
    if (moveEmitters(scene, delta) || changes.isSnapshot()) nameEmitters();
    // Listeners and views.
    for (const InstanceId id : delta.placedRemoved) {
        others_.erase(id.slot);
        poses_.erase(id.slot);
    }
    for (const auto* list : {&delta.placedAdded, &delta.placedRebound})
        for (const Placed& placed : *list)
            if (placed.kind == PlacedKind::listener || placed.kind == PlacedKind::view)
                others_[placed.id.slot] = placed;
    for (const InstanceDelta::Moved& moved : delta.placedMoved)
        if (const auto it = others_.find(moved.id.slot); it != others_.end() && it->second.id == moved.id)
            it->second.worldFromLocal = moved.worldFromLocal;
    // A binding shows as a change of isBound.
    if (changes.isSnapshot() || !delta.placedAdded.empty() || !delta.placedRemoved.empty() ||
        !delta.placedMoved.empty() || !delta.placedRebound.empty() || !delta.placedChanged.empty()) {
        chooseListener(scene);
        findPositions(scene);
    }
}

}  // namespace rtsg
