// Binds replay tests: a recorded session compared with a scene that is run afresh on its input.
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/sync/log_table.h>
#include <rtsg/sync/replay_test.h>

#include "errors.h"
#include "module.h"
#include "scene_handle.h"
#include "unlocked.h"
#include "values.h"

namespace py = pybind11;
namespace fs = std::filesystem;

namespace rtsg::python {

namespace {

/// Calls Python functions with the scenes of the test; an exception ends the test, and is raised after it.
class Calls {
  public:
    /// While the scenes are still there.
    void end() {
        const py::gil_scoped_acquire lock;
        for (const auto& handle : handles_) handle->end();
    }
    /// The Scene object of a scene of the test, the same each time.
    SceneHandle& handle(Scene& scene, bool readOnly) {
        for (const auto& known : handles_)
            if (&known->scene() == &scene) return *known;
        handles_.push_back(SceneHandle::borrow(scene, nullptr, {}, readOnly));
        return *handles_.back();
    }
    template <class... Arguments>
    Result<> call(const py::object& function, Scene& scene, bool readOnly, Arguments... arguments) {
        const py::gil_scoped_acquire lock;
        try {
            SceneHandle& known = handle(scene, readOnly);
            function(objectOf(known), arguments...);
            known.raisePending();
            return {};
        } catch (py::error_already_set& error) {
            const std::string text = error.what();
            if (!raised_) raised_ = std::make_unique<py::error_already_set>(std::move(error));
            return fail(text);
        }
    }
    void raiseAny() {
        if (!raised_) return;
        const py::error_already_set raised = std::move(*raised_);
        raised_.reset();
        throw raised;
    }

  private:
    std::vector<std::shared_ptr<SceneHandle>> handles_;
    std::unique_ptr<py::error_already_set> raised_;
};

Result<> loadWhole(Scene& scene, const fs::path& file) {
    runScripts(scene);
    Diagnostics found(file.string());
    const bool usable = loadFile(scene, file, found);
    for (const Diagnostic& d : found.all())
        if (d.severity == Severity::error) return std::unexpected(d);
    if (!usable) return fail("nothing usable in it", {}, file.string());
    return {};
}

py::object reportOf(const ReplayReport& report) {
    const py::module_ types = py::module_::import("rtsg._types");
    py::list differences;
    for (const FieldDifference& d : report.differences)
        differences.append(types.attr("FieldDifference")(d.node, d.field, d.frame, sinceStart(d.time, report.start),
                                                         d.states, d.largest, d.text, d.cause));
    py::object divergence = py::none();
    if (report.divergence) {
        const Divergence& d = *report.divergence;
        divergence = types.attr("Divergence")(d.frame, sinceStart(d.time, report.start), d.node, d.field, d.text);
    }
    return types.attr("ReplayReport")(report.passed(), report.frames, report.verified, divergence, differences,
                                      report.updated, report.format());
}

py::object runTest(const fs::path& log, const py::object& scene, const py::object& application, const py::object& check,
                   const std::vector<std::string>& fields, const std::vector<std::string>& ignore, double tolerance,
                   bool update) {
    Calls calls;
    ReplayTest test;
    test.log = log;
    test.compared = {fields, ignore, tolerance};
    if (auto ok = test.compared.check(); !ok) raise(ok.error());
    test.update = update;
    if (py::isinstance<py::function>(scene) || PyCallable_Check(scene.ptr())) {
        test.build = [&](Scene& created) -> Result<> {
            runScripts(created);
            registerDocuments(created);
            return calls.call(scene, created, false);
        };
    } else if (!scene.is_none()) {
        test.build = [file = py::cast<fs::path>(scene)](Scene& created) { return loadWhole(created, file); };
    }
    if (!application.is_none())
        test.application = [&](Scene& created, double t) { return calls.call(application, created, false, t); };
    Scene* running = nullptr;
    test.attach = [&](Scene& created) -> Result<> {
        running = &created;
        return {};
    };
    test.finish = [&]() -> Result<> {
        calls.end();
        return {};
    };
    Interruption interruption;
    bool interrupted = false;
    test.check = [&](const Scene&) -> Result<> {
        interrupted = interruption();
        if (interrupted) return fail("interrupted");
        return check.is_none() ? Result<>{} : calls.call(check, *running, false);
    };
    const auto report = unlocked([&] { return runReplayTest(test); });
    if (interrupted) interruption.raise();
    calls.raiseAny();
    if (!report) raise(report.error());
    return reportOf(*report);
}

}  // namespace

void addReplayTests(py::module_& module) {
    module.def(
        "replay_test", runTest, py::arg("log"), py::kw_only(), py::arg("scene") = py::none(),
        py::arg("application") = py::none(), py::arg("check") = py::none(),
        py::arg("fields") = std::vector<std::string>(), py::arg("ignore") = std::vector<std::string>(),
        py::arg("tolerance") = 0., py::arg("update") = false,
        "Runs a recorded session as a test: a ReplayReport. `scene`: a file, or a function that builds the scene it "
        "is given, which is run afresh on the recorded input, and every frame has to be the recorded one; None: the "
        "log is replayed and its hashes verified. `application`: called with the scene and the time before each "
        "frame, in place of the recorded edits. `check`: called with the scene in every state; what it raises ends "
        "the test. `fields`, `ignore` (\"DOOR.*\", \"initial\") and `tolerance`: what is compared, else whole "
        "states. `update`: writes the log anew.");
}

}  // namespace rtsg::python
