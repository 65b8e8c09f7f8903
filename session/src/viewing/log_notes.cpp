// Plays a log aside, and notes inputs from outside, damage, and the changes of a field.
#include "viewing/log_notes.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include <rtsg/core/device_input.h>
#include <rtsg/core/frame_input.h>
#include <rtsg/core/x3d.h>
#include <rtsg/session/moments.h>
#include <rtsg/session/replay_tests.h>
#include <rtsg/sync/blame.h>

namespace rtsg {

namespace {

constexpr std::size_t kMaxMarks = 2000, kMaxLines = 400;
constexpr double kOneEvent = 0.5;  // seconds: input of a kind that comes again within this time is part of the same
                                   // event

/// Finds changes from outside, as texts for marks: "Ann: DOOR.rotation". Moves of pointers and viewers do not count.
class Events {
  public:
    std::string text(const Scene& scene, const ChangeSet& set) {
        names_.clear();
        const auto look = [&](const std::vector<Change>& changes) {
            for (const Change& change : changes)
                if (change.external) add(scene, change);
        };
        look(set.changes);
        if (set.input) look(set.input->events);
        if (names_.empty()) return {};
        std::string text;
        for (const std::string& name : names_) {
            text += (text.empty() ? "" : ", ") + name;
            if (text.size() > kLongest) break;
        }
        if (set.authors && !set.authors->empty()) text = set.authors->front().author.str() + ": " + text;
        return text;
    }

  private:
    static constexpr std::size_t kLongest = 80;
    void add(const Scene& scene, const Change& change) {
        if (change.kind == ChangeKind::createNode) {
            names_.insert("nodes made");
        } else if (change.node == scene.root()) {
            addDevice(change);
        } else if (const Node* node = scene.find(change.node); node && change.field < node->type().fieldCount()) {
            const std::string_view name = scene.name(change.node);
            names_.insert(
                fmt::format("{}.{}", name.empty() ? node->type().name : name, node->type().fields[change.field].name));
        }
    }
    void addDevice(const Change& change) {
        if (change.field == x3d::RtsgScene::pointer.index && change.value.holds<Array<double>>()) {
            const auto pointer = PointerInput::fromValue(change.value.as<Array<double>>());
            if (!pointer) return;
            if ((pointer->buttons & ~buttons_) != 0) names_.insert("a click");
            buttons_ = pointer->buttons;
        } else if (change.field == x3d::RtsgScene::key.index && change.value.holds<Array<std::int32_t>>()) {
            const auto key = KeyInput::fromValue(change.value.as<Array<std::int32_t>>());
            if (key && key->down) names_.insert("a key");
        } else if (change.field == x3d::RtsgScene::text.index) {
            names_.insert("text");
        }
    }
    std::set<std::string> names_;
    std::uint32_t buttons_ = 0;
};

}  // namespace

void LogNotes::marks(SceneWindowTimeline& line) {
    if (!std::exchange(begun_, true)) marking_.run([this] { readMarks(); });
    const std::scoped_lock lock(mutex_);
    line.marks = marks_;
    line.marksVersion = version_;
}

/// A log that cannot be read has no marks: whoever plays it says why.
void LogNotes::readMarks() {
    const auto opened = Replayer::open(file_);
    if (!opened) return;
    Replayer& replayer = **opened;
    const auto start = replayer.keyframes().empty() ? 0 : replayer.keyframes().front().time;
    std::size_t damaged = 0;
    std::uint64_t gaps = 0;
    Events events;
    std::string last;
    double lastAt = -1;
    const auto note = [&](double time, std::string text, bool isDamage) {
        const std::scoped_lock lock(mutex_);
        if (marks_.size() >= kMaxMarks) return;
        marks_.push_back({time, std::move(text), isDamage});
        ++version_;
    };
    while (!marking_.stops()) {
        const Result<bool> more = replayer.step();
        const double time = std::max(0., replayer.time() - start);
        const auto& damage = replayer.log().damage();
        for (; damaged < damage.size(); ++damaged) note(time, "damaged: " + damage[damaged].text, true);
        if (replayer.gaps() > std::exchange(gaps, replayer.gaps())) note(time, "states are missing before", true);
        if (!more) {
            note(time, more.error().text, true);
            continue;
        }
        if (!*more) return;
        if (replayer.lastSet().isSnapshot()) continue;
        std::string text = events.text(replayer.scene(), replayer.lastSet());
        if (text.empty()) continue;
        const bool again = text == last && time - lastAt < kOneEvent;
        lastAt = time;
        last = text;
        if (!again) note(time, std::move(text), false);
    }
}

void LogNotes::ask(const std::string& field) {
    forget();
    stale_ = false;
    {
        const std::scoped_lock lock(mutex_);
        history_.push_back({field, "the log is being read ...", false, {}});
    }
    asking_.run([this, field] { readHistory(field); });
}

void LogNotes::forget() {
    stale_ = true;
    asking_.finish();
    const std::scoped_lock lock(mutex_);
    history_.clear();
}

void LogNotes::readHistory(const std::string& field) {
    const auto steps = blame(file_, field, [this](std::uint64_t, std::uint64_t) { return !stale_; });
    std::vector<SceneWindowStatus::Line> lines;
    if (!steps) {
        lines.push_back({field, steps.error().text, true, {}});
    } else {
        const double start = logStart(file_);
        lines.push_back({field, fmt::format("{} value{}", steps->size(), steps->size() == 1 ? "" : "s"), false, {}});
        for (std::size_t i = 0; i < steps->size(); ++i) {
            const FieldStep& step = (*steps)[i];
            // Changes that the scene itself drives are reported once.
            const auto isAlike = [&](const FieldStep& b) { return b.author == step.author && b.cause == step.cause; };
            if (i > 0 && !step.wasSet && isAlike((*steps)[i - 1])) continue;
            if (lines.size() > kMaxLines) break;
            const std::string by = step.author.empty() ? step.cause : fmt::format("{}, {}", step.author, step.cause);
            const double time = std::max(0., step.time - start);
            lines.push_back(
                {fmt::format("{:.2f} s", time), fmt::format("{}  {}", step.value.substr(0, 40), by), false, time});
        }
    }
    const std::scoped_lock lock(mutex_);
    history_ = std::move(lines);
}

std::vector<SceneWindowStatus::Line> LogNotes::history() const {
    const std::scoped_lock lock(mutex_);
    return history_;
}

}  // namespace rtsg
