// Compares chosen fields of two scenes, and finds the causes of the differences.
#include <rtsg/sync/field_comparison.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include <fmt/format.h>

#include <rtsg/core/field_text.h>

#include "cause.h"
#include "excerpt.h"

namespace rtsg {

namespace {

constexpr std::size_t kMaxHistories = 64, kMaxSamples = 4096, kNone = SIZE_MAX;
constexpr double kApart = std::numeric_limits<double>::infinity();

/// Matches a pattern in which * stands for any letters.
bool matches(std::string_view pattern, std::string_view text) {
    std::size_t p = 0, t = 0, star = std::string_view::npos, from = 0;
    while (t < text.size()) {
        if (p < pattern.size() && pattern[p] == '*') {
            star = p++;
            from = t;
        } else if (p < pattern.size() && pattern[p] == text[t]) {
            ++p, ++t;
        } else if (star != std::string_view::npos) {
            p = star + 1;
            t = ++from;
        } else {
            return false;
        }
    }
    return pattern.find_first_not_of('*', p) == std::string_view::npos;
}

struct Pattern {
    explicit Pattern(const std::string& written) : text(written) {
        const std::size_t dot = text.rfind('.');
        node = text.substr(0, dot);
        field = text.substr(dot + 1);
    }
    bool fits(std::string_view path, std::string_view fieldName) const {
        const std::size_t slash = path.rfind('/');
        const bool here =
            matches(node, path) || (slash != std::string_view::npos && matches(node, path.substr(slash + 1)));
        return here && matches(field, fieldName);
    }
    std::string text, node, field;
    bool used = false;
};

/// The node's DEF name behind those of the PROTO instances and Inlines around it. Empty if one of them has no name.
std::string pathOf(const Scene& scene, NodeId id) {
    std::string path(scene.name(id));
    if (path.empty()) return path;
    for (const Node* node = scene.find(id); node && node->scope(); node = scene.find(node->scope())) {
        const std::string_view outer = scene.name(node->scope());
        if (outer.empty()) return {};
        path.insert(0, fmt::format("{}/", outer));
    }
    return path;
}

/// Names nodes by DEF name or type, because their numbers differ between versions of a scene.
std::string nodesText(const Scene& scene, const Value& value) {
    const auto label = [&](NodeId id) -> std::string {
        if (!id) return "NULL";
        std::string path = pathOf(scene, id);
        const Node* node = scene.find(id);
        return !path.empty() ? path : node ? node->type().name : "?";
    };
    if (value.type() == FieldType::SFNode) return label(value.as<NodeId>());
    std::string text = "[";
    for (const NodeId id : value.as<Array<NodeId>>()) text += (text.size() > 1 ? ", " : "") + label(id);
    return text + "]";
}

/// Writes up to four components into `into` and returns how many. 0 if the value has more, or none.
int numbers(const Value& value, std::array<float, 4>& into) {
    const auto take = [&](const auto& v, int n) {
        for (int i = 0; i < n; ++i) into[static_cast<std::size_t>(i)] = static_cast<float>(v[i]);
        return n;
    };
    switch (value.type()) {
        case FieldType::SFBool:
            return into[0] = value.as<bool>(), 1;
        case FieldType::SFInt32:
            return into[0] = static_cast<float>(value.as<std::int32_t>()), 1;
        case FieldType::SFFloat:
            return into[0] = value.as<float>(), 1;
        case FieldType::SFDouble:
            return into[0] = static_cast<float>(value.as<double>()), 1;
        case FieldType::SFVec2f:
            return take(value.as<Vec2f>(), 2);
        case FieldType::SFVec3f:
            return take(value.as<Vec3f>(), 3);
        case FieldType::SFVec4f:
            return take(value.as<Vec4f>(), 4);
        case FieldType::SFColor: {
            const Color& c = value.as<Color>();
            return into = {c.r, c.g, c.b, 0}, 3;
        }
        case FieldType::SFRotation: {
            const Rotation& r = value.as<Rotation>();
            return into = {r.x, r.y, r.z, r.angle}, 4;
        }
        default:
            return 0;
    }
}

}  // namespace

Result<> FieldSelection::check() const {
    if (!(tolerance >= 0) || std::isinf(tolerance)) return fail(fmt::format("no tolerance: {}", tolerance));
    for (const auto* patterns : {&fields, &ignore})
        for (const std::string& p : *patterns) {
            const std::size_t dot = p.rfind('.');
            if (patterns == &ignore && p == "initial") continue;
            if (dot == std::string::npos || dot == 0 || dot + 1 == p.size())
                return fail(fmt::format("'{}' is no NODE.field, such as HOOK.translation or DOOR.*", p));
        }
    return {};
}

struct FieldComparison::State {
    struct Side {
        const Scene& scene;
        std::unordered_map<std::uint32_t, std::vector<std::size_t>> watches;  // by node number
        FrameTouches touched;
    };
    struct FieldSlot {
        NodeId node;
        FieldIndex field = kNoField;
    };
    struct Watch {
        std::string path, field;
        FieldSlot a, b;
        bool happened = false, queued = false, differs = false;
        std::size_t difference = kNone;
        FieldHistory history;
    };

    State(FieldSelection chosen, const Scene& x, const Scene& y, DifferenceWords said, bool alike)
        : selection(std::move(chosen)), ofEither(alike), a{x, {}, {}}, b{y, {}, {}}, words(said) {
        if (selection.fields.empty()) selection.fields.emplace_back("*.*");
        for (const std::string& p : selection.fields) fields.emplace_back(p);
        for (const std::string& p : selection.ignore) {
            if (p == "initial")
                initialCounts = false;
            else
                ignored.emplace_back(p);
        }
    }

    bool chosen(std::string_view path, std::string_view field) {
        bool any = false;
        for (Pattern& p : fields)
            if (p.fits(path, field)) p.used = any = true;
        bool ignores = false;
        for (Pattern& p : ignored)
            if (any && p.fits(path, field)) p.used = ignores = true;
        return any && !ignores;
    }

    void bind(Side& side, const Node& node) {
        const std::string path = pathOf(side.scene, node.id());
        if (path.empty()) return;
        const bool first = &side == &a;
        bool isNew = false;
        for (FieldIndex i = 0; i < node.type().fields.size(); ++i) {
            const FieldDef& def = node.type().fields[i];
            if (!def.readable() || def.hidden) continue;
            std::string key = fmt::format("{}.{}", path, def.name);
            auto found = byName.find(key);
            if (found == byName.end()) {
                if (!(first || ofEither) || !chosen(path, def.name)) continue;
                found = byName.emplace(std::move(key), watches.size()).first;
                Watch& created = watches.emplace_back();
                created.path = path;
                created.field = def.name;
                isNew = true;
            }
            Watch& watch = watches[found->second];
            (first ? watch.a : watch.b) = FieldSlot{.node = node.id(), .field = i};
            auto& ofNode = side.watches[node.id().value];
            if (std::ranges::find(ofNode, found->second) == ofNode.end()) ofNode.push_back(found->second);
            queue(found->second);
        }
        // The node may have appeared in the other scene earlier.
        Side& opposite = first ? b : a;
        if (const Node* other = isNew ? findPath(opposite.scene, path) : nullptr) bind(opposite, *other);
    }
    void unbind(Side& side, NodeId node) {
        const auto found = side.watches.find(node.value);
        if (found == side.watches.end()) return;
        for (const std::size_t i : found->second) {
            FieldSlot& field = &side == &a ? watches[i].a : watches[i].b;
            if (field.node != node) continue;
            field = {};
            queue(i);
        }
        side.watches.erase(found);
    }
    static const Node* findPath(const Scene& scene, std::string_view path) {
        NodeId scope;
        while (true) {
            const std::size_t slash = path.find('/');
            scope = scene.findName(path.substr(0, slash), scope);
            if (!scope || slash == std::string_view::npos) return scene.find(scope);
            path.remove_prefix(slash + 1);
        }
    }

    void queue(std::size_t i) {
        if (std::exchange(watches[i].queued, true)) return;
        waiting.push_back(i);
    }
    void changed(Side& side, const ChangeSet& set) {
        side.touched.add(set);
        for (const Change& c : set.changes) {
            if (c.kind == ChangeKind::setName || c.kind == ChangeKind::destroyNode) {
                unbind(side, c.node);
                if (const Node* node = side.scene.find(c.node); node && c.kind == ChangeKind::setName)
                    bind(side, *node);
                continue;
            }
            if (c.kind != ChangeKind::setField && c.kind != ChangeKind::insertChild &&
                c.kind != ChangeKind::removeChild)
                continue;
            const auto found = side.watches.find(c.node.value);
            if (found == side.watches.end()) continue;
            for (const std::size_t i : found->second) {
                const FieldSlot& field = &side == &a ? watches[i].a : watches[i].b;
                if (field.field != c.field) continue;
                watches[i].happened = true;
                queue(i);
            }
        }
    }

    /// The distance between both values of the field; `text` gets both values.
    double distance(const Watch& w, std::string& text) const {
        const Node* x = w.a.node ? a.scene.find(w.a.node) : nullptr;
        const Node* y = w.b.node ? b.scene.find(w.b.node) : nullptr;
        if (!x && (!y || !ofEither)) return 0;
        if (!x || !y) return text = fmt::format("only in {}", x ? words.a : words.b), kApart;
        const Value p = x->value(w.a.field), q = y->value(w.b.field);
        if (p.type() != q.type() || typeNameOf(p) != typeNameOf(q))
            return text = fmt::format("{} {}, {} {}", words.a, typeNameOf(p), words.b, typeNameOf(q)), kApart;
        const bool nodes = sf(p.type()) == FieldType::SFNode;
        if (!nodes && p == q) return 0;
        const std::string s = nodes ? nodesText(a.scene, p) : printFieldText(p);
        const std::string t = nodes ? nodesText(b.scene, q) : printFieldText(q);
        const double d = nodes ? (s == t ? 0 : kApart) : valueDistance(p, q);
        text = fmt::format("{} {}, {} {}", words.a, excerpt(s, t), words.b, excerpt(t, s));
        return d;
    }
    void sample(Watch& w) {
        if (histories >= kMaxHistories && w.history.samples.empty()) return;
        if (w.history.samples.size() >= kMaxSamples || !w.a.node || !w.b.node) return;
        FieldHistory::Sample s;
        s.time = a.scene.now();
        const int n = numbers(a.scene.node(w.a.node).value(w.a.field), s.a);
        if (n == 0 || numbers(b.scene.node(w.b.node).value(w.b.field), s.b) != n) return;
        if (w.history.samples.empty()) ++histories;
        w.history.components = n;
        w.history.samples.push_back(s);
    }
    std::string causeOf(const Watch& w) const {
        const auto of = [](const Side& side, const FieldSlot& field) {
            return field.node ? describe(side.touched.cause(side.scene, field.node, field.field)) : std::string();
        };
        // The second scene is under test. If nothing happened in it, the cause in the first scene tells what should
        // have happened.
        const bool second = b.touched.has(w.b.node, w.b.field);
        if (!ofEither && second) return of(b, w.b);
        std::string x = of(a, w.a);
        const std::string y = ofEither ? of(b, w.b) : std::string();
        if (x == y) return x;
        if (x.empty() || y.empty()) return fmt::format("{} only: {}", x.empty() ? words.b : words.a, x + y);
        return fmt::format("{}: {}; {}: {}", words.a, x, words.b, y);
    }
    static std::string describe(const FrameTouches::Cause& cause) {
        return cause.author.empty() ? cause.text : fmt::format("{}, as {} asked", cause.text, cause.author);
    }

    void compareOne(std::size_t i) {
        Watch& w = watches[i];
        w.queued = false;
        if (!initialCounts && !w.happened) return;
        sample(w);
        std::string text;
        const double d = distance(w, text);
        const bool differs = d > selection.tolerance;
        if (differs != w.differs) {
            w.differs = differs;
            if (differs)
                now.push_back(i);
            else
                std::erase(now, i);
        }
        if (!differs) return;
        if (w.difference == kNone) {
            w.difference = differences.size();
            differences.push_back({w.path, w.field, a.scene.sequence(), 0, a.scene.now(), 0, 0, text, causeOf(w)});
        }
        FieldDifference& found = differences[w.difference];
        found.largest = std::max(found.largest, d);
    }
    bool compare() {
        std::vector<std::size_t> due;
        due.swap(waiting);
        // Puts causes before effects: a field comes after the fields that lead to it by routes.
        std::ranges::sort(due);
        const std::size_t before = differences.size();
        for (const std::size_t i : due) compareOne(i);
        std::ranges::stable_sort(differences.begin() + static_cast<std::ptrdiff_t>(before), differences.end(), {},
                                 [](const FieldDifference& d) { return std::ranges::count(d.cause, '>'); });
        for (std::size_t i = before; i < differences.size(); ++i)
            watches[byName.at(differences[i].node + "." + differences[i].field)].difference = i;
        for (const std::size_t i : now) {
            FieldDifference& d = differences[watches[i].difference];
            ++d.states;
            d.last = a.scene.sequence();
        }
        a.touched.clear();
        b.touched.clear();
        return now.empty();
    }

    FieldSelection selection;
    std::vector<Pattern> fields, ignored;
    bool initialCounts = true, ofEither = false;
    Side a, b;
    DifferenceWords words;
    std::vector<Watch> watches;
    std::unordered_map<std::string, std::size_t> byName;
    std::vector<std::size_t> waiting, now;  // indices of watches to compare, and of those that differ now
    std::vector<FieldDifference> differences;
    std::size_t histories = 0;
};

FieldComparison::FieldComparison(FieldSelection selection, const Scene& a, const Scene& b, DifferenceWords words,
                                 Fields whose)
    : state_(std::make_unique<State>(std::move(selection), a, b, words, whose == Fields::ofEither)) {}
FieldComparison::~FieldComparison() = default;

bool FieldComparison::first() {
    state_->a.scene.forEachNode([this](const Node& node) { state_->bind(state_->a, node); });
    state_->b.scene.forEachNode([this](const Node& node) { state_->bind(state_->b, node); });
    return compare();
}

void FieldComparison::changedA(const ChangeSet& set) {
    state_->changed(state_->a, set);
}
void FieldComparison::changedB(const ChangeSet& set) {
    state_->changed(state_->b, set);
}
bool FieldComparison::compare() {
    return state_->compare();
}

const std::vector<FieldDifference>& FieldComparison::differences() const {
    return state_->differences;
}

std::vector<FieldHistory> FieldComparison::histories() const {
    std::vector<FieldHistory> result;
    for (const FieldDifference& d : state_->differences) {
        const State::Watch& w = state_->watches[state_->byName.at(d.node + "." + d.field)];
        if (w.history.samples.size() < 2) continue;
        result.push_back(w.history);
        result.back().node = w.path;
        result.back().field = w.field;
    }
    return result;
}

std::string FieldComparison::nothingCompared() const {
    for (const Pattern& p : state_->fields)
        if (!p.used) return fmt::format("{}: no such field, so nothing was compared", p.text);
    return state_->watches.empty() ? "all of the fields that were asked for are left out, so nothing was compared" : "";
}

std::vector<std::string> FieldComparison::ignoredInVain() const {
    std::vector<std::string> result;
    for (const Pattern& p : state_->ignored)
        if (!p.used) result.push_back(p.text);
    return result;
}

std::size_t FieldComparison::fieldCount() const {
    return state_->watches.size();
}

}  // namespace rtsg
