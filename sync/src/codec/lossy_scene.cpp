// Keeps a second scene whose moving values lie on a grid, so that they take fewer bits.
#include <rtsg/sync/lossy_scene.h>

#include <algorithm>
#include <cmath>

#include <rtsg/core/portable_math.h>

#include "columns/value_history.h"

namespace rtsg {

namespace {

/// A value counts as resting after so many frames without a change.
constexpr std::uint32_t kRest = 2;
constexpr std::size_t kMaxValues = std::size_t{1} << 20;

/// The distance between what two values mean, whatever their bits.
double distance(FieldType type, const float* a, const float* b) {
    double x[4] = {}, y[4] = {};
    const int lanes = wire::gridLanesOf(type);
    const auto read = [&](const float* floats, double* to) {
        double scale = 1;
        if (type == FieldType::SFRotation)
            scale = static_cast<double>(floats[3]) / portable::hypot(static_cast<double>(floats[0]),
                                                                     static_cast<double>(floats[1]),
                                                                     static_cast<double>(floats[2]));
        for (int l = 0; l < lanes; ++l) to[l] = static_cast<double>(floats[l]) * scale;
    };
    read(a, x);
    read(b, y);
    double square = 0;
    for (int l = 0; l < lanes; ++l) square += (x[l] - y[l]) * (x[l] - y[l]);
    return std::sqrt(square);  // distance of rotation vectors, which is never less than the angle between the rotations
}

}  // namespace

struct LossyScene::State {
    explicit State(double error) : maxError(error), sealer(*this) { scene.setBehavioursEnabled(false); }

    /// The first subscriber on the scene's bus. It gives the set that is being published the hash of the state that it
    /// leads to.
    struct Sealer : Subscriber {
        explicit Sealer(State& owner) : state(owner) {}
        Result<> apply(const Scene& shown, const ChangeSet&) override {
            if (state.set) state.set->hash = shown.hash();
            return {};
        }
        std::string subscriberName() const override { return "lossy scene's seal"; }
        State& state;
    };
    struct Field {
        wire::Table* table;
        FieldIndex field;
        std::uint32_t slot;
    };

    /// Meaning of the slot: stamp is the frame of the last change; onGrid means not exact; depth is 1 after a change,
    /// and 2 while the slot is listed in `rounded`.
    bool roundInMotion(Change& change, wire::Table& table, std::uint32_t at) {
        wire::Slot& slot = table.slots[at];
        const bool moving = slot.depth > 0 && frame - slot.stamp <= kRest;
        slot.stamp = frame;
        slot.depth = std::max<std::uint8_t>(slot.depth, 1);
        slot.onGrid = false;
        if (!moving) return false;
        const FieldType type = change.value.type();
        float exact[4] = {}, nearest[4] = {};
        std::int32_t grid[4] = {}, again[4] = {};
        std::memcpy(exact, change.value.storage(), info(type).elementSize);
        const double step = wire::gridStep(type, maxError);
        wire::toGrid(type, exact, step, grid);
        wire::fromGrid(type, grid, step, nearest);
        wire::toGrid(type, nearest, step, again);
        // This also excludes values that are not finite or beyond the grid's end, and axes without a direction.
        if (!(distance(type, exact, nearest) <= maxError) || !std::equal(grid, grid + 4, again)) return false;
        if (std::memcmp(exact, nearest, info(type).elementSize) == 0) return true;
        change.value = Value::fromStorage(type, nearest);
        slot.onGrid = true;
        return true;
    }

    void settle(const Scene& origin) {
        std::vector<Change> exact;
        std::erase_if(rounded, [&](const Field& f) {
            wire::Slot& slot = f.table->slots[f.slot];
            if (slot.onGrid && frame - slot.stamp < kRest) return false;
            slot.depth = 1;
            if (!std::exchange(slot.onGrid, false)) return true;
            const Node* node = origin.find(NodeId{slot.node});
            if (!node) return true;
            Change& change = exact.emplace_back();
            change.node = node->id();
            change.field = f.field;
            change.external = false;
            change.value = node->value(f.field);
            return true;
        });
        statistics.settled += exact.size();
        const auto end =
            std::ranges::find_if(set->changes, [](const Change& c) { return c.kind >= ChangeKind::setName; });
        set->changes.insert(end, std::move_iterator(exact.begin()), std::move_iterator(exact.end()));
    }

    double maxError;
    Scene scene;
    LossyStatistics statistics;
    wire::ValueHistory fields;
    std::vector<Field> rounded;
    std::uint32_t frame = 0;
    std::shared_ptr<ChangeSet> set;
    Sealer sealer;
    Attachment sealed, following;  // destroyed in reverse order
};

LossyScene::LossyScene(double maxError) : state_(std::make_unique<State>(maxError)) {
    state_->sealed = state_->scene.bus().attach(state_->sealer);
}
LossyScene::~LossyScene() = default;

Result<std::unique_ptr<LossyScene>> LossyScene::follow(Scene& origin, double maxError) {
    if (!(maxError > 0) || !std::isfinite(maxError)) return fail("the largest error has to be finite and above 0");
    std::unique_ptr<LossyScene> lossy(new LossyScene(maxError));
    lossy->state_->following = origin.bus().attach(*lossy);
    if (!lossy->state_->following.attached()) return fail(lossy->state_->following.failure());
    return lossy;
}

Scene& LossyScene::scene() {
    return state_->scene;
}
double LossyScene::maxError() const {
    return state_->maxError;
}
const LossyStatistics& LossyScene::statistics() const {
    return state_->statistics;
}

Result<> LossyScene::apply(const Scene& origin, const ChangeSet& changes) {
    State& s = *state_;
    s.set = std::make_shared<ChangeSet>(changes);
    s.set->input.reset();  // the input does not lead to this scene's state
    ++s.frame;
    if (changes.isSnapshot()) {
        s.fields.clear();
        s.rounded.clear();
        if (s.scene.sequence() != 0)
            if (auto ok = s.scene.reset(); !ok) return ok;
    } else {
        for (Change& change : s.set->changes) {
            if (change.kind != ChangeKind::setField || wire::lanesOf(change.value.type()) == 0) continue;
            wire::Table& table = s.fields.table(change.field, change.value.type());
            const std::uint32_t at = table.findOrAdd(change.node.value);
            ++(s.roundInMotion(change, table, at) ? s.statistics.onGrid : s.statistics.exact);
            wire::Slot& slot = table.slots[at];
            if (slot.onGrid && slot.depth < 2) {
                slot.depth = 2;
                s.rounded.push_back({&table, change.field, at});
            }
        }
        s.settle(origin);
        // Drops fields of destroyed nodes, too. Dropping a field only makes its next change exact.
        if (s.rounded.empty() && s.fields.slots() > kMaxValues) s.fields.clear();
    }
    const Result<> applied = s.scene.apply(s.set);
    s.set.reset();
    return applied;
}

}  // namespace rtsg
