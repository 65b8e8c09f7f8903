// Compares chosen fields of two logs step by step: by state if they are of one session, else by time.
#include <cmath>

#include <fmt/format.h>

#include <rtsg/sync/field_comparison.h>

namespace rtsg {

namespace {

/// Doubles that hold the time since 1970 are exact to a quarter of this.
constexpr double kSameTime = 1e-6;

/// One of the two logs, with its replay.
class Side {
  public:
    static Result<Side> open(const std::filesystem::path& file) {
        auto replayer = Replayer::open(file);
        if (!replayer) return std::unexpected(replayer.error());
        Side side(std::move(*replayer));
        const Result<bool> first = side.log_->step();
        if (!first) return std::unexpected(first.error());
        if (!*first) return fail("no intact state", {}, file.string());
        side.start_ = side.log_->scene().now();
        return side;
    }
    /// Two logs of one session, say a server's and a mirror's, have the same states, but one may begin later. If the
    /// early log has the late log's first state, with the same number and time, it is stepped up to that. Otherwise
    /// both go by the time since their start.
    static Result<> meet(Side& x, Side& y) {
        Side &early = x.state() <= y.state() ? x : y, &late = &early == &x ? y : x;
        if (!early.holds(late.state(), late.scene().now())) return {};
        y.start_ = x.start_;
        while (early.state() < late.state() && early.more())
            if (auto ok = early.step([](const ChangeSet&) {}); !ok) return ok;
        return {};
    }
    const Scene& scene() const { return log_->scene(); }
    std::uint64_t state() const { return scene().sequence(); }
    double time() const { return log_->scene().now() - start_; }
    const LogReader& log() const { return log_->log(); }
    bool more() const { return more_; }

    Result<> step(const std::function<void(const ChangeSet&)>& changed) {
        const Result<bool> more = log_->step();
        if (!more) return std::unexpected(more.error());
        more_ = *more;
        if (more_) changed(log_->lastSet());
        return whole();
    }

  private:
    bool holds(std::uint64_t state, double time) const {
        auto log = LogReader::open(log_->log().file());
        if (!log) return false;
        while (const auto record = log->next())
            if (record->header.to == state && record->header.time == time && record->header.kind != RecordKind::index)
                return true;
        return false;
    }
    explicit Side(std::unique_ptr<Replayer> log) : log_(std::move(log)) {}
    Result<> whole() const {
        if (log_->gaps() == 0) return {};
        return fail("states are missing: rtsg replay --verify names them", {}, log_->log().file().string());
    }

    std::unique_ptr<Replayer> log_;
    double start_ = 0;
    bool more_ = true;
};

}  // namespace

Result<LogFieldReport> diffLogFields(const std::filesystem::path& a, const std::filesystem::path& b,
                                     const FieldSelection& selection) {
    if (auto ok = selection.check(); !ok) return std::unexpected(ok.error());
    Result<Side> opened[] = {Side::open(a), Side::open(b)};
    for (const auto& side : opened)
        if (!side) return std::unexpected(side.error());
    Side &x = *opened[0], &y = *opened[1];
    if (auto met = Side::meet(x, y); !met) return std::unexpected(met.error());
    FieldComparison fields(selection, x.scene(), y.scene(), {}, FieldComparison::Fields::ofEither);
    LogFieldReport report;
    const auto changedA = [&](const ChangeSet& set) { fields.changedA(set); };
    const auto changedB = [&](const ChangeSet& set) { fields.changedB(set); };
    fields.first();
    ++report.states;
    while (true) {
        // Steps both logs if they are in step, else the one that is behind in time.
        const double tx = x.time(), ty = y.time();
        if (std::isnan(tx) || std::isnan(ty)) return fail("a state has no time", {}, a.string());
        if (tx <= ty + kSameTime)
            if (auto ok = x.step(changedA); !ok) return std::unexpected(ok.error());
        if (ty <= tx + kSameTime)
            if (auto ok = y.step(changedB); !ok) return std::unexpected(ok.error());
        if (!x.more() || !y.more()) break;
        if (std::abs(x.time() - y.time()) > kSameTime) continue;
        fields.compare();
        report.end = x.time();
        ++report.states;
    }
    if (x.more() != y.more())
        report.unequalEnds =
            fmt::format("{} ends before {} does", (x.more() ? b : a).string(), (x.more() ? a : b).string());
    report.damage = {x.log().damageText(), y.log().damageText()};
    report.fields = fields.fieldCount();
    report.differences = fields.differences();
    report.ignoredInVain = fields.ignoredInVain();
    if (std::string why = fields.nothingCompared(); !why.empty()) return fail(std::move(why), {}, a.string());
    return report;
}

}  // namespace rtsg
