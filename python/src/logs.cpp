// Binds logs: read state by state or column by column, compared, and written.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <rtsg/documents/loader.h>
#include <rtsg/sync/blame.h>
#include <rtsg/sync/log_check.h>
#include <rtsg/sync/log_recorder.h>
#include <rtsg/sync/log_summary.h>
#include <rtsg/sync/log_table.h>
#include <rtsg/sync/replay.h>

#include "changes.h"
#include "collected.h"
#include "errors.h"
#include "module.h"
#include "unlocked.h"
#include "values.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace rtsg::python {

namespace {

py::object typeNamed(const char* name) {
    return py::module_::import("rtsg._types").attr(name);
}

py::object toPython(const std::optional<Divergence>& d, double start) {
    if (!d) return py::none();
    return typeNamed("Divergence")(d->frame, sinceStart(d->time, start), d->node, d->field, d->text);
}

/// A log, and the scene that it is replayed into.
class Log {
  public:
    Log(const fs::path& file, const std::string& base) : file_(file) {
        replayer_ = std::shared_ptr<Replayer>(take(unlocked([&] { return Replayer::open(file); })));
        check_ = std::make_unique<LogCheck>(*replayer_);
        registerDocuments(replayer_->scene());
        SceneHandle::Options options;
        options.file = file;
        if (base.empty()) {
            options.resources = Resources::ofFile(file);
        } else {
            ResourcePolicy policy;
            policy.roots.emplace_back(base);
            options.resources = Resources(base, policy);
        }
        const auto created = SceneHandle::borrow(replayer_->scene(), replayer_, std::move(options), true);
        handle_ = created.get();
        scene_ = py::cast(created);
        start_ = replayer_->keyframes().empty() ? 0 : replayer_->keyframes().front().time;
        if (!step()) raise(Diagnostic{Severity::error, file.string(), {}, "there is no intact state in it"});
    }

    /// For use of the replay: raises Closed, WrongThread.
    Replayer& replayer() const {
        (void)handle_->scene();
        return *replayer_;
    }
    bool step() {
        (void)replayer();
        handle_->refuseFromWithin("a log does not go on");
        const auto more = handle_->work([&] { return check_->step(); });
        handle_->raisePending();
        report();
        return take(more);
    }
    void seek(double seconds) {
        Replayer& inside = replayer();
        handle_->refuseFromWithin("a log does not go on");
        take(handle_->work([&] { return inside.seek(start_ + seconds); }));
        check_ = std::make_unique<LogCheck>(inside);
        handle_->raisePending();
    }
    /// To the first state that is not before this time. False: there is none.
    bool seekFirst(double seconds) {
        seek(seconds - kSame);
        while (time() < seconds - kSame)
            if (!step()) return false;
        return true;
    }
    /// Times since 1970 are exact to a quarter of this.
    static constexpr double kSame = 1e-6;
    py::object changes() const {
        return python::toPython(std::make_shared<const ChangeSet>(replayer().lastSet()), scene_);
    }
    double time() const { return sinceStart(replayer().time(), start_); }
    double start() const { return start_; }
    const fs::path& file() const { return file_; }
    const py::object& scene() const { return scene_; }
    void close() {
        if (handle_->isClosed()) return;
        (void)handle_->scene();
        handle_->refuseFromWithin("a log is not closed");
        check_.reset();
        handle_->close();
        replayer_.reset();
    }

    int traverse(visitproc visit, void* arg) {
        Py_VISIT(scene_.ptr());
        return 0;
    }
    void clear() {}

  private:
    /// Once, of the first thing that is not whole.
    void report() {
        if (reported_ || !check_->first()) return;
        reported_ = true;
        Divergence first = *check_->first();
        first.time = sinceStart(first.time, start_);
        warn(file_.string() + ": " + first.format());
    }

    fs::path file_;
    std::shared_ptr<Replayer> replayer_;
    std::unique_ptr<LogCheck> check_;
    py::object scene_;
    SceneHandle* handle_ = nullptr;
    double start_ = 0;
    bool reported_ = false;
};

// ---- tables --------------------------------------------------------------------------------------------------------

template <class T>
py::object numbersOf(const LogTable::Column& column, const std::vector<py::ssize_t>& one, std::size_t bytes) {
    std::vector<py::ssize_t> shape = one;
    shape.insert(shape.begin(), static_cast<py::ssize_t>(column.rows.size()));
    py::array_t<T> array(shape);
    auto* to = reinterpret_cast<std::byte*>(array.mutable_data());
    for (const auto& row : column.rows) {
        if (row)
            std::memcpy(to, row->storage(), bytes);
        else if constexpr (std::is_floating_point_v<T>)
            std::fill_n(reinterpret_cast<T*>(to), bytes / sizeof(T), std::numeric_limits<T>::quiet_NaN());
        to += bytes;
    }
    return array;
}

/// A node by its name, or "#12".
py::object labelOf(NodeId id, const Scene& scene) {
    if (!id) return py::none();
    const std::string_view name = scene.find(id) ? scene.name(id) : std::string_view();
    return py::str(name.empty() ? "#" + std::to_string(id.value) : std::string(name));
}

py::object objectOf(const Value& value, const py::object& scene) {
    const Scene& inside = py::cast<const SceneHandle&>(scene).scene();
    if (value.type() == FieldType::SFNode) return labelOf(value.as<NodeId>(), inside);
    if (value.type() != FieldType::MFNode) return python::toPython(value, scene);
    py::list labels;
    for (const NodeId id : value.as<Array<NodeId>>()) labels.append(labelOf(id, inside));
    return py::tuple(labels);
}

py::object objectsOf(const LogTable::Column& column, const py::object& scene) {
    py::object array = py::module_::import("numpy").attr("empty")(column.rows.size(), py::arg("dtype") = "object");
    for (std::size_t i = 0; i < column.rows.size(); ++i)
        if (column.rows[i]) array[py::int_(i)] = objectOf(*column.rows[i], scene);
    return array;
}

/// Numbers as they are; where rows lack a value, floats with NaN, and None among objects.
py::object arrayOf(const LogTable::Column& column, const py::object& scene) {
    if (isMF(column.type) || !numberType(column.type)) return objectsOf(column, scene);
    const bool whole = std::ranges::all_of(column.rows, [](const auto& row) { return row.has_value(); });
    const std::size_t bytes = info(column.type).elementSize;
    const auto one = dimensions(column.type);
    switch (numberType(column.type)->char_()) {
        case 'f':
            return numbersOf<float>(column, one, bytes);
        case 'd':
            return numbersOf<double>(column, one, bytes);
        case '?':
            if (whole) return numbersOf<bool>(column, one, bytes);
            break;
        default:
            if (whole) return numbersOf<std::int32_t>(column, one, bytes);
    }
    py::array_t<double> array(static_cast<py::ssize_t>(column.rows.size()));
    double* to = array.mutable_data();
    for (const auto& row : column.rows)
        *to++ = !row ? std::nan("") : column.type == FieldType::SFBool ? row->as<bool>() : row->as<std::int32_t>();
    return array;
}

/// The columns, the types of their fields, and the names of the numbers in a row.
py::tuple table(const Log& log, const std::vector<std::string>& paths, double from, double to, std::uint64_t every) {
    if (paths.empty()) throw py::value_error("table() takes at least one \"NODE.field\"");
    if (every == 0) throw py::value_error("every is 1 or more");
    TableOptions options{from, to, every, {}};
    Interruption interruption;
    bool interrupted = false;
    options.progress = [&](std::uint64_t, std::uint64_t) { return !(interrupted = interruption()); };
    std::optional<Divergence> lacks;
    // A replay of its own: the log's scene stays where it is.
    auto read = unlocked([&] { return readTable(log.file(), paths, options, &lacks); });
    if (interrupted) interruption.raise();
    if (!read && read.error().code == DiagnosticCode("no-such-field")) raise(read.error(), "NoSuchName");
    const LogTable created = take(std::move(read));
    if (lacks) warn(log.file().string() + ": " + lacks->format());
    py::dict result, types, parts;
    const std::vector<double>& times = created.times();
    result["time"] = py::array_t<double>(static_cast<py::ssize_t>(times.size()), times.data());
    for (const LogTable::Column* const column : created.columns()) {
        result[py::str(column->name)] = arrayOf(*column, log.scene());
        types[py::str(column->name)] = column->now ? typeNameOf(*column->now) : fieldTypeName(column->type, nullptr);
        parts[py::str(column->name)] = py::cast(componentNames(column->type));
    }
    return py::make_tuple(result, types, parts);
}

// ---- what a log tells ----------------------------------------------------------------------------------------------

py::dict summary(const Log& log) {
    const LogSummary s = take(unlocked([&] { return summariseLog(log.file()); }));
    py::dict all;
    all["bytes"] = s.bytes, all["states"] = s.states, all["keyframes"] = s.keyframes, all["inputs"] = s.inputs;
    all["sessions"] = s.sessions, all["first_state"] = s.firstState, all["last_state"] = s.lastState;
    all["seconds"] = s.end - s.start, all["damaged"] = s.damaged, all["damaged_bytes"] = s.damagedBytes;
    all["gaps"] = s.gaps, all["missing_states"] = s.missingFrames, all["closed"] = s.closed;
    all["being_written"] = s.beingWritten, all["creator"] = s.creator, all["nodes"] = s.nodes;
    return all;
}

/// (offset in bytes, seconds since the log's start) of each whole state that is there for seeking.
py::list keyframes(const Log& log) {
    py::list all;
    for (const LogKeyframe& one : log.replayer().keyframes())
        all.append(py::make_tuple(one.offset, sinceStart(one.time, log.start())));
    return all;
}

py::dict verify(const Log& log) {
    Interruption interruption;
    bool interrupted = false;
    std::optional<Divergence> first;
    py::dict all;
    std::uint64_t frames = 0, verified = 0, gaps = 0, damaged = 0;
    const auto ended = unlocked([&]() -> Result<> {
        auto replayer = Replayer::open(log.file());
        if (!replayer) return std::unexpected(replayer.error());
        LogCheck check(**replayer);
        while (!(interrupted = interruption()) && check.step().value_or(true)) continue;
        check.expectClosed();
        first = check.first();
        frames = (*replayer)->frames(), verified = (*replayer)->verified(), gaps = (*replayer)->gaps();
        damaged = (*replayer)->log().damage().size();
        return {};
    });
    if (interrupted) interruption.raise();
    take(ended);
    all["states"] = frames, all["verified"] = verified, all["gaps"] = gaps, all["damaged"] = damaged;
    all["first_divergence"] = toPython(first, log.start());
    return all;
}

py::list damage(const Log& log) {
    py::list all;
    auto reader = take(LogReader::open(log.file()));
    unlocked([&] {
        while (reader.next()) continue;
    });
    for (const LogDamage& one : reader.damage()) all.append(typeNamed("Damage")(one.offset, one.length, one.text));
    return all;
}

py::list blameOf(const Log& log, const std::string& path) {
    std::optional<Divergence> lacks;
    Interruption interruption;
    auto found = unlocked(
        [&] { return blame(log.file(), path, [&](std::uint64_t, std::uint64_t) { return !interruption(); }, &lacks); });
    interruption.raise();
    const auto steps = take(std::move(found));
    if (lacks) warn(log.file().string() + ": " + lacks->format());
    py::list all;
    for (const FieldStep& step : steps)
        all.append(typeNamed("FieldStep")(step.state, sinceStart(step.time, log.start()), step.value, step.author,
                                          step.cause));
    return all;
}

py::object diff(const fs::path& a, const fs::path& b) {
    const auto found = unlocked([&] { return diffLogs(a, b); });
    return toPython(take(found), 0);
}

// ---- writing -------------------------------------------------------------------------------------------------------

/// The scene keeps it until it is closed.
class Recorder final : public Dependent {
  public:
    Recorder(SceneHandle& handle, std::unique_ptr<LogRecorder> recorder)
        : handle_(&handle), recorder_(std::move(recorder)) {}

    void end() noexcept override {
        if (const auto ok = recorder_->stop(); !ok) handle_->note(ok.error());
        recorder_.reset();
    }
    void abandon() noexcept override { (void)recorder_.release(); }
    static void close(const std::shared_ptr<Recorder>& self) {
        if (!self->recorder_) return;
        (void)self->handle_->scene();
        self->handle_->remove(*self);
        const auto ok = unlocked([&] { return self->recorder_->stop(); });
        self->recorder_.reset();
        take(ok);
    }
    LogRecorder& recorder() const {
        if (!recorder_) raise(DiagnosticCode("application"), "the log is closed", "Closed");
        return *recorder_;
    }

  private:
    SceneHandle* handle_;  // good while there is a recorder
    std::unique_ptr<LogRecorder> recorder_;
};

std::shared_ptr<Recorder> record(SceneHandle& handle, const fs::path& file, bool inputs, bool replace,
                                 double keyframes) {
    Scene& inside = handle.between();
    LogOptions options;
    options.creator = "rtsg python";
    options.existing = replace ? Existing::replace : Existing::keep;
    options.keyframeSeconds = keyframes;
    options.inputs = inputs && !handle.isReadOnly();
    if (options.inputs) inside.setInputRecording(true);
    auto started =
        handle.work([&] { return LogRecorder::start(inside, file, options, LogRecorder::WhenBehind::wait); });
    handle.raisePending();
    auto recorder = std::make_shared<Recorder>(handle, take(std::move(started)));
    handle.own(recorder);
    return recorder;
}

void addRecorder(py::module_& module) {
    py::class_<Recorder, std::shared_ptr<Recorder>>(
        module, "Recorder", "A log that is written until this or the scene is closed; made by Scene.record().")
        .def("close", &Recorder::close, "Writes what is left. Raises Error for whatever went wrong since the start.")
        .def_property_readonly(
            "bytes", [](const Recorder& r) { return r.recorder().bytes(); }, "Written so far.")
        .def_property_readonly(
            "acknowledged", [](const Recorder& r) { return r.recorder().acknowledged(); },
            "The number of the last state that is in the file.")
        .def("__enter__", [](py::object self) { return self; })
        .def("__exit__", [](const std::shared_ptr<Recorder>& r, const py::args&) { Recorder::close(r); });
    auto scene = py::class_<SceneHandle, std::shared_ptr<SceneHandle>>(module.attr("Scene"));
    scene.def(
        "record", record, py::arg("path"), py::kw_only(), py::arg("inputs") = true, py::arg("replace") = true,
        py::arg("keyframe_seconds") = 10.,
        "Writes every state into a log from now on: a Recorder, which close() ends. `inputs`: with what came into each "
        "frame, for tests that run the scene again. `replace`: a file of that name is replaced once the log begins.");
}

}  // namespace

void addLogs(py::module_& module) {
    py::class_<Log>(module, "Log", collected<Log>(), "A log, and a scene that is brought to any state of it.")
        .def(py::init<const fs::path&, const std::string&>(), py::arg("path"), py::kw_only(), py::arg("base") = "")
        .def_property_readonly(
            "scene", [](const Log& l) { return l.scene(); },
            "The scene in the state that the log is at; it is read and pictured like any scene.")
        .def_property_readonly("time", &Log::time, "Of that state, seconds since the log's start.")
        .def_property_readonly("start", &Log::start, "Scene time at which the log starts, seconds.")
        .def_property_readonly("changes", &Log::changes, "The ChangeSet that led to that state.")
        .def_property_readonly(
            "at_end", [](const Log& l) { return l.replayer().atEnd(); }, "No state comes after it.")
        .def("step", &Log::step, "To the next state. False at the end.")
        .def("seek", &Log::seek, py::arg("seconds"), "To the last state at or before this time since the log's start.")
        .def("_seek_first", &Log::seekFirst)
        .def_property_readonly("_keyframes", keyframes)
        .def("_table", table, py::arg("paths"), py::arg("start"), py::arg("stop"), py::arg("every"))
        .def_property_readonly("summary", summary, "States, bytes, seconds, damage and so on, as a dict.")
        .def("verify", verify,
             "Replays all of it: a dict of states, those verified by their hash, gaps, and the first "
             "Divergence or None.")
        .def_property_readonly("damage", damage, "Damage by Damage: bytes that no intact record covers.")
        .def("blame", blameOf, py::arg("path"),
             "FieldStep by FieldStep: when \"NODE.field\" got which value, by whom, and by which routes.")
        .def("close", &Log::close, "Closes the log and its scene.")
        .def("__enter__", [](py::object self) { return self; })
        .def("__exit__", [](Log& l, const py::args&) { l.close(); });
    module.def("diff", diff, py::arg("a"), py::arg("b"),
               "Compares two logs state by state: the first Divergence, scene time, or None.");
    addRecorder(module);
}

}  // namespace rtsg::python
