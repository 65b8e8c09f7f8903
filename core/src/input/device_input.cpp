// Device input as field values, and the part of it that a frame takes.
#include <rtsg/core/device_input.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include <rtsg/core/navigation.h>
#include <rtsg/core/portable_math.h>
#include <rtsg/core/x3d.h>

#include "avatar.h"
#include "scene/view_pose.h"
#include "state/state.h"

namespace rtsg {

namespace {

using Root = x3d::RtsgScene;

/// The layout of a PointerInput as numbers: these, then those of a hit, then the numbers of the nodes on its path. If
/// the picture has placed any of these nodes, a 0 follows, and for each its place on the path and a matrix, column by
/// column.
enum PointerNumber : std::size_t { kDevice, kButtons, kKind, kBearing, kHasHit = kBearing + 6, kHit, kPath = kHit + 8 };
constexpr std::size_t kLongestPath = 10'000, kByPicture = 13;

bool isFinite(const Vec3d& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}
bool isComplete(double number, double minimum, double maximum) {
    return number >= minimum && number <= maximum && number == std::floor(number);
}
bool isCharacter(std::int64_t code) {
    return code > 0 && code <= 0x10FFFF && (code < 0xD800 || code > 0xDFFF);
}

struct KeyName {
    std::string_view name;
    char32_t character;
    ActionKey action;
};
constexpr KeyName kKeyNames[] = {
    {"HOME", 0, ActionKey::home},         {"END", 0, ActionKey::end},      {"PGUP", 0, ActionKey::pageUp},
    {"PGDN", 0, ActionKey::pageDown},     {"UP", 0, ActionKey::up},        {"DOWN", 0, ActionKey::down},
    {"LEFT", 0, ActionKey::left},         {"RIGHT", 0, ActionKey::right},  {"SHIFT", 0, ActionKey::shift},
    {"CONTROL", 0, ActionKey::control},   {"ALT", 0, ActionKey::alt},      {"ENTER", '\n', ActionKey::none},
    {"BACKSPACE", '\b', ActionKey::none}, {"ESCAPE", 27, ActionKey::none}, {"TAB", '\t', ActionKey::none},
    {"SPACE", ' ', ActionKey::none},
};

/// The one character of a UTF-8 text; 0 if it is none or several.
char32_t onlyCharacter(std::string_view text) {
    if (text.empty() || text.size() > 4) return 0;
    const auto first = static_cast<unsigned char>(text[0]);
    const std::size_t length = first < 0x80 ? 1 : first < 0xE0 ? 2 : first < 0xF0 ? 3 : 4;
    if (length != text.size() || (first >= 0x80 && first < 0xC2)) return 0;
    char32_t code = length == 1 ? first : first & (0x7Fu >> length);
    for (std::size_t i = 1; i < length; ++i) {
        const auto next = static_cast<unsigned char>(text[i]);
        if ((next & 0xC0u) != 0x80) return 0;
        code = code << 6 | (next & 0x3Fu);
    }
    return isCharacter(code) ? code : 0;
}

}  // namespace

// ---- values ------------------------------------------------------------------------------------------------------

Array<double> PointerInput::toValue() const {
    Array<double> value{double(device), double(buttons), double(static_cast<int>(kind))};
    if (kind == Kind::picture)
        for (const double number : {x, y, aspect, 0.0, 0.0, 0.0}) value.push_back(number);
    else
        for (const double number : {origin.x, origin.y, origin.z, direction.x, direction.y, direction.z})
            value.push_back(kind == Kind::ray ? number : 0);
    value.push_back(hit ? 1 : 0);
    if (!hit) return value;
    const Vec3d &p = hit->point, &n = hit->normal;
    for (const double number : {p.x, p.y, p.z, n.x, n.y, n.z, hit->texCoord.x, hit->texCoord.y})
        value.push_back(number);
    for (const NodeId node : hit->path) value.push_back(node.value);
    if (hit->byPicture.empty()) return value;
    value.push_back(0);
    for (const PointerHit::ByPicture& one : hit->byPicture) {
        value.push_back(double(one.at));
        for (int i = 0; i < 12; ++i) value.push_back(one.parentFromLocal[i / 3][i % 3]);
    }
    return value;
}

namespace {

/// From behind the 0 on. Error: not what toValue() makes.
Result<> readByPicture(const Array<double>& v, std::size_t from, PointerHit& hit) {
    if ((v.size() - from) % kByPicture != 0) return fail("where a picture has placed nodes is of a wrong length");
    for (std::size_t i = from; i < v.size(); i += kByPicture) {
        const double minimum = hit.byPicture.empty() ? 0 : double(hit.byPicture.back().at + 1);
        if (!isComplete(v[i], minimum, double(hit.path.size()) - 1))
            return fail("a picture has placed a node that is not on the path");
        PointerHit::ByPicture one{static_cast<std::size_t>(v[i])};
        for (std::size_t n = 0; n < 12; ++n) {
            if (!std::isfinite(v[i + 1 + n])) return fail("where a picture has placed a node is not finite");
            one.parentFromLocal[static_cast<int>(n / 3)][static_cast<int>(n % 3)] = v[i + 1 + n];
        }
        hit.byPicture.push_back(one);
    }
    return {};
}

}  // namespace

Result<PointerInput> PointerInput::fromValue(const Array<double>& v) {
    if (v.size() <= kHasHit) return fail("a pointer's event is too short");
    if (!isComplete(v[kDevice], 0, kDevices - 1))
        return fail(fmt::format("no pointer {}: 0 to {}", v[kDevice], kDevices - 1));
    if (!isComplete(v[kButtons], 0, UINT32_MAX)) return fail("a pointer's buttons are no set");
    if (!isComplete(v[kKind], 0, 2)) return fail("a pointer's event is of an unknown kind");
    PointerInput input;
    input.device = static_cast<std::int32_t>(v[kDevice]);
    input.buttons = static_cast<std::uint32_t>(v[kButtons]);
    input.kind = static_cast<Kind>(v[kKind]);
    const auto at = [&](std::size_t first) { return Vec3d(v[first], v[first + 1], v[first + 2]); };
    const Vec3d a = at(kBearing), b = at(kBearing + 3);
    if (input.kind == Kind::ray) {
        const double largest = std::max({std::abs(b.x), std::abs(b.y), std::abs(b.z)});
        // The release of a button counts wherever its pointer is.
        if (!isFinite(a) || !isFinite(b) || !(largest > 0)) return input.kind = Kind::absent, input;
        input.origin = a;
        input.direction = b;
    } else if (input.kind == Kind::picture) {
        if (!isFinite(a) || !(a.z > 0)) return input.kind = Kind::absent, input;
        input.x = a.x;
        input.y = a.y;
        input.aspect = a.z;
    }
    if (v[kHasHit] == 0) return input;
    if (v.size() < kPath || v.size() > kPath + (1 + kByPicture) * kLongestPath)
        return fail("what a pointer is over is of a wrong length");
    PointerHit hit{at(kHit), at(kHit + 3), {v[kHit + 6], v[kHit + 7]}, {}};
    if (!isFinite(hit.point) || !isFinite(hit.normal) || !std::isfinite(v[kHit + 6] + v[kHit + 7])) return input;
    for (std::size_t i = kPath; i < v.size(); ++i) {
        if (v[i] == 0 && i > kPath) {
            if (auto ok = readByPicture(v, i + 1, hit); !ok) return std::unexpected(ok.error());
            break;
        }
        if (hit.path.size() == kLongestPath) return fail("what a pointer is over is of a wrong length");
        if (!isComplete(v[i], 1, UINT32_MAX)) return fail("the path to what a pointer is over names no node");
        hit.path.push_back(NodeId{static_cast<std::uint32_t>(v[i])});
    }
    input.hit = std::move(hit);
    return input;
}

Array<std::int32_t> KeyInput::toValue() const {
    return {down ? 1 : 0, static_cast<std::int32_t>(character), static_cast<std::int32_t>(action)};
}

Result<KeyInput> KeyInput::fromValue(const Array<std::int32_t>& v) {
    if (v.size() != 3 || v[0] < 0 || v[0] > 1)
        return fail("a key's event has three numbers, of which the first is 0 or 1");
    if (v[2] < 0 || v[2] > static_cast<std::int32_t>(ActionKey::alt))
        return fail(fmt::format("no action key {}", v[2]));
    if (v[2] == 0 && !isCharacter(v[1])) return fail(fmt::format("U+{:04X} is no character", v[1]));
    KeyInput input;
    input.down = v[0] == 1;
    input.action = static_cast<ActionKey>(v[2]);
    if (v[2] == 0) input.character = static_cast<char32_t>(v[1]);
    return input;
}

Result<KeyInput> KeyInput::named(std::string_view name, bool down) {
    for (const KeyName& one : kKeyNames)
        if (one.name == name) return KeyInput{down, one.character, one.action};
    const auto number = [&](std::size_t skip, int base) {
        std::int64_t value = 0;
        const char* end = name.data() + name.size();
        const auto [stopped, wrong] = std::from_chars(name.data() + skip, end, value, base);
        return wrong == std::errc() && stopped == end ? value : 0;
    };
    if (name.size() > 1 && name[0] == 'F')
        if (const auto n = number(1, 10); n >= 1 && n <= 12) return KeyInput{down, 0, static_cast<ActionKey>(n)};
    if (name.starts_with("U+"))
        if (const auto code = number(2, 16); isCharacter(code)) return KeyInput{down, static_cast<char32_t>(code)};
    if (const char32_t only = onlyCharacter(name)) return KeyInput{down, only};
    return fail(fmt::format("'{}' is no key: a character, U+1F600, F1 to F12, HOME, SHIFT, ENTER and the like", name));
}

// ---- sending -----------------------------------------------------------------------------------------------------

Result<> sendPointer(Scene& scene, const PointerInput& input) {
    if (input.device < 0 || input.device >= PointerInput::kDevices)
        return fail(fmt::format("no pointer {}: 0 to {}", input.device, PointerInput::kDevices - 1));
    return scene.sendEvent(scene.root(), Root::pointer.index, input.toValue());
}
Result<> sendKey(Scene& scene, const KeyInput& input) {
    const Array<std::int32_t> value = input.toValue();
    if (auto ok = KeyInput::fromValue(value); !ok) return std::unexpected(ok.error());
    return scene.sendEvent(scene.root(), Root::key.index, value);
}
Result<> sendText(Scene& scene, std::string_view text) {
    return scene.sendEvent(scene.root(), Root::text.index, String(text));
}
Result<> sendWheel(Scene& scene, double across, double down) {
    if (!std::isfinite(across) || !std::isfinite(down)) return fail("a wheel's steps are not finite");
    return scene.sendEvent(scene.root(), Root::wheel.index, Array<double>{across, down});
}
Result<> sendHeadPose(Scene& scene, const Vec3d& position, const Rotation& r) {
    if (!isFinite(position) || !std::isfinite(r.x + r.y + r.z + r.angle)) return fail("a head's pose is not finite");
    return scene.sendEvent(
        scene.root(), Root::headPose.index,
        Array<double>{position.x, position.y, position.z, double(r.x), double(r.y), double(r.z), double(r.angle)});
}

Bearing bearingThrough(const Scene& scene, double x, double y, double aspect) {
    WorldTransforms positions(scene);
    const Viewer viewer = positions.viewer(scene.root());
    const Node* view = viewer.viewpoint ? scene.find(viewer.viewpoint) : nullptr;
    const double right = 2 * x - 1, up = 1 - 2 * y;
    Bearing bearing{viewer.position, {0, 0, -1}};
    if (view && view->is(x3d::OrthoViewpoint::type)) {
        // One side grows until all of the extent shows (23.4.5).
        const auto [left, bottom, rightEdge, top] = extentOf(*view);
        double half[2] = {(rightEdge - left) / 2, (top - bottom) / 2};
        if (half[0] < half[1] * aspect)
            half[0] = half[1] * aspect;
        else
            half[1] = half[0] / aspect;
        const Vec3d at((left + rightEdge) / 2 + right * half[0], (bottom + top) / 2 + up * half[1], 0);
        bearing.origin += viewer.orientation * at;
    } else {
        const double t = portable::tan(std::clamp(fieldOfViewOf(view), 1e-6, M_PI - 1e-6) / 2);
        bearing.direction = Vec3d(right * t * std::max(aspect, 1.0), up * t / std::min(aspect, 1.0), -1);
    }
    bearing.direction = glm::normalize(viewer.orientation * bearing.direction);
    return bearing;
}

void Scene::setSpaceQueries(SpaceQueries* queries) {
    if (state_->refuseForeign()) return;
    state_->queries = queries;
    state_->pickCorners.clear();
}
void Scene::setNavigation(bool on) {
    if (!state_->refuseForeign()) state_->navigates = on;
}

// ---- what a frame takes ------------------------------------------------------------------------------------------

namespace {

/// Beyond this many that wait, a pointer's events but the last are left out, and keys' and texts' are refused.
constexpr std::size_t kMaxWaiting = 256;

}  // namespace

/// Merges the moves of a pointer into one. The press or release that follows them is taken with it, and later events
/// wait.
void Scene::State::deferPointers() {
    struct Pointer {
        std::uint32_t buttons = 0;
        std::size_t taken = SIZE_MAX;
        bool closed = false;
        std::vector<std::size_t> waiting;
    };
    std::map<std::int32_t, Pointer> pointers;
    const auto& rows = find(owner.root())->get(Root::_pointers);
    std::vector<bool> void_(inputQueue.size());
    for (std::size_t i = 0; i < inputQueue.size(); ++i) {
        const QueuedEvent& event = inputQueue[i];
        if (event.node != owner.root() || event.field != Root::pointer.index) continue;
        const auto given = PointerInput::fromValue(event.value.as<Array<double>>());
        if (!given) continue;  // refused when it is delivered
        const auto [found, isNew] = pointers.try_emplace(given->device);
        Pointer& pointer = found->second;
        for (std::size_t k = 0; isNew && k + kPointerRow <= rows.size(); k += kPointerRow)
            if (rows[k] == given->device) pointer.buttons = static_cast<std::uint32_t>(rows[k + 1]);
        if (pointer.closed) {
            pointer.waiting.push_back(i);
            continue;
        }
        if (pointer.taken != SIZE_MAX) void_[pointer.taken] = true;
        pointer.taken = i;
        pointer.closed = given->buttons != pointer.buttons;
    }
    for (auto& [device, pointer] : pointers) {
        if (pointer.waiting.size() > kMaxWaiting) {
            diagnostics.warning({}, fmt::format("pointer {} was pressed and let go more often than frames could take: "
                                                "{} events are left out",
                                                device, pointer.waiting.size() - 1));
            for (std::size_t i = 0; i + 1 < pointer.waiting.size(); ++i) void_[pointer.waiting[i]] = true;
            pointer.waiting = {pointer.waiting.back()};
        }
        for (const std::size_t i : pointer.waiting) {
            deferredInput.push_back(std::move(inputQueue[i]));
            void_[i] = true;
        }
    }
    std::size_t next = 0;
    std::erase_if(inputQueue, [&](const QueuedEvent&) { return void_[next++]; });
}

/// One key a frame, or what of a text is before the end of a line, in the order of both: they send one event a
/// timestamp.
void Scene::State::deferKeys() {
    bool taken = false;
    std::size_t waiting = 0, refused = 0;
    std::vector<QueuedEvent> kept;
    for (QueuedEvent& event : inputQueue) {
        const bool isText = event.field == Root::text.index;
        if (event.node != owner.root() || (!isText && event.field != Root::key.index)) {
            kept.push_back(std::move(event));
        } else if (taken) {
            if (++waiting <= kMaxWaiting)
                deferredInput.push_back(std::move(event));
            else
                ++refused;
        } else {
            taken = true;
            if (isText) {
                const std::string text = event.value.as<String>().str();
                const std::size_t end = text.find('\n');
                if (end != std::string::npos && end + 1 < text.size()) {
                    QueuedEvent rest = event;
                    rest.value = Value(String(std::string_view(text).substr(end + 1)));
                    event.value = Value(String(std::string_view(text).substr(0, end + 1)));
                    deferredInput.push_back(std::move(rest));
                }
            }
            kept.push_back(std::move(event));
        }
    }
    inputQueue.swap(kept);
    if (refused > 0)
        diagnostics.warning({}, fmt::format("keys came faster than frames could take them: {} are left out", refused));
}

/// The layer of the sensor that the pointer has hold of: a drag stays in its own layer, whatever lies over it now.
std::optional<NodeId> Scene::State::layerHeld(std::int32_t device) const {
    for (const NodeId id : find(owner.root())->get(Root::_pointed)) {
        const Node* node = find(id);
        const FieldIndex holder = node ? node->type().findExact("_holder") : kNoField;
        if (holder == kNoField || node->get(Field<std::int32_t>{holder}) != device + 1) continue;
        if (const Node* layer = layerOf(owner, id)) return layer->id();
    }
    return std::nullopt;
}

void Scene::State::castRays() {
    // The queries may have to bring their geometry up to date first, and so send events, which are queued behind these.
    for (std::size_t i = 0; i < inputQueue.size(); ++i) {
        if (inputQueue[i].node != owner.root() || inputQueue[i].field != Root::pointer.index) continue;
        auto given = PointerInput::fromValue(inputQueue[i].value.as<Array<double>>());
        if (!given) continue;
        if (given->kind == PointerInput::Kind::picture) {
            given->kind = PointerInput::Kind::ray;
            auto seen = queries ? queries->throughPicture(given->x, given->y, layerHeld(given->device)) : std::nullopt;
            if (seen) {
                given->origin = seen->origin;
                given->direction = seen->direction;
                given->hit = std::move(seen->hit);
                inputQueue[i].value = Value(given->toValue());
                continue;
            }
            const Bearing bearing = bearingThrough(owner, given->x, given->y, given->aspect);
            given->origin = bearing.origin;
            given->direction = bearing.direction;
        }
        // A hit that came with the event counts only if nobody here can cast the ray.
        if (queries) given->hit.reset();
        if (queries && given->kind == PointerInput::Kind::ray)
            given->hit = queries->firstHit(given->origin, given->direction);
        inputQueue[i].value = Value(given->toValue());
    }
}

/// 23.4.2: finds the Collision nodes that the avatar touches; sends an event when they change.
void Scene::State::feelContacts() {
    constexpr std::uint32_t kShapes = aspectBit(Aspect::structure) | aspectBit(Aspect::transform) |
                                      aspectBit(Aspect::view) | aspectBit(Aspect::geometry);
    if (!queries || collisionNodes == 0 || ((touched | touchedBefore) & kShapes) == 0) return;
    const Node& root = *find(owner.root());
    double radius = .25;  // 23.4.4, the default
    if (const Node* info = topOfStack(owner, "_navigationStack"))
        if (info->is(x3d::NavigationInfo::type))
            if (const auto& size = info->get(x3d::NavigationInfo::avatarSize); !size.empty()) radius = size[0];
    if (!(radius >= 0) || !std::isfinite(radius)) return;
    WorldTransforms fresh(owner);
    std::vector<NodeId> touchedNodes;
    for (const std::vector<NodeId>& path : queries->within(fresh.viewer(owner.root()).position, radius)) {
        // Where a Collision switches collisions off, the Collisions above it feel nothing either.
        if (!stopsAvatars(owner, path)) continue;
        for (const NodeId id : path)
            if (const Node* node = find(id); node && node->is(x3d::Collision::type)) touchedNodes.push_back(id);
    }
    std::ranges::sort(touchedNodes);
    touchedNodes.erase(std::unique(touchedNodes.begin(), touchedNodes.end()), touchedNodes.end());
    if (std::ranges::equal(touchedNodes, root.get(Root::_contacts))) return;
    Array<std::int32_t> value;
    for (const NodeId id : touchedNodes) value.push_back(static_cast<std::int32_t>(id.value));
    inputQueue.push_back({owner.root(), Root::contact.index, Value(value)});
}

void Scene::State::prepareInput(double t) {
    if (playing || !behavioursEnabled) return;
    bool pointers = false, keys = false, moves = navigates;
    for (const QueuedEvent& event : inputQueue) {
        if (event.node != owner.root()) continue;
        pointers |= event.field == Root::pointer.index;
        moves |= event.field == Root::navigate.index;
        keys |= event.field == Root::key.index || event.field == Root::text.index;
    }
    if (pointers) deferPointers();
    if (pointers) castRays();
    if (keys) deferKeys();
    viewerMoved = false;
    if (moves) navigate(t);
    feelContacts();
    pick();
}

}  // namespace rtsg
