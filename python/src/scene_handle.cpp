// The life of a scene in Python: how it is made, runs, tells of failures, and ends.
#include "scene_handle.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include <rtsg/audio/sound_file.h>
#include <rtsg/documents/loader.h>
#include <rtsg/renderers/text_measure.h>
#include <rtsg/scripts/run_scripts.h>

#include "changes.h"
#include "errors.h"
#include "unlocked.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {

std::mutex livingMutex;
std::vector<SceneHandle*> living;

SharedWorld::Options worldOptions(const Resources& resources) {
    SharedWorld::Options options;
    options.flattening.maxOccurrences = resources.policy().maximumInstances;
    return options;
}

}  // namespace

// ---- subscribers ---------------------------------------------------------------------------------------------------

Subscription::Subscription(SceneHandle& handle, py::function call)
    : handle_(&handle),
      call_(std::move(call)),
      name_(py::cast<std::string>(py::str(py::getattr(call_, "__qualname__", py::str("a Python function"))))) {}

Subscription::~Subscription() = default;

void Subscription::begin() {
    attachment_ = handle_->scene().bus().attach(*this);
}

void Subscription::end() {
    attachment_.detach();
    call_ = py::function();
    if (SceneHandle* const handle = std::exchange(handle_, nullptr)) handle->forget(*this);
}

Result<> Subscription::apply(const Scene&, const ChangeSet& changes) {
    const py::gil_scoped_acquire lock;
    if (!call_) return {};
    const py::function call = call_;  // it may end itself
    SceneHandle& handle = *handle_;
    try {
        callWith(call, objectOf(handle), changes);
        return {};
    } catch (py::error_already_set& error) {
        error_ = error.value();
        const std::string text = error.what();
        handle.keep(std::move(error));
        return fail(text);
    }
}

// ---- making and ending ---------------------------------------------------------------------------------------------

SceneHandle::SceneHandle(Scene& scene, std::shared_ptr<void> keeper, Options options, bool readOnly)
    : scene_(&scene),
      keeper_(std::move(keeper)),
      options_(std::move(options)),
      readOnly_(readOnly),
      said_(options_.file.string()),
      inlineDiagnostics_(options_.file.string()) {
    scene.bus().setReporter([reports = reports_](const Diagnostic& failure) {
        const std::scoped_lock lock(reports->mutex);
        reports->failures.push_back(failure);
    });
    const std::scoped_lock lock(livingMutex);
    living.push_back(this);
}

std::shared_ptr<SceneHandle> SceneHandle::make(Options options) {
    auto scene = std::make_shared<Scene>();
    registerDocuments(*scene);
    if (options.scripts) runScripts(*scene);
    scene->setScriptResources(std::make_shared<const Resources>(options.resources));
    Scene& inside = *scene;
    return std::shared_ptr<SceneHandle>(new SceneHandle(inside, std::move(scene), std::move(options), false));
}

std::shared_ptr<SceneHandle> SceneHandle::makeReplica(Options options) {
    auto scene = std::make_shared<Scene>();
    registerDocuments(*scene);
    Scene& inside = *scene;
    return std::shared_ptr<SceneHandle>(new SceneHandle(inside, std::move(scene), std::move(options), true));
}

std::shared_ptr<SceneHandle> SceneHandle::borrow(Scene& scene, std::shared_ptr<void> keeper, Options options,
                                                 bool readOnly) {
    return std::shared_ptr<SceneHandle>(new SceneHandle(scene, std::move(keeper), std::move(options), readOnly));
}

SceneHandle::~SceneHandle() {
    end();
    const std::scoped_lock lock(livingMutex);
    std::erase(living, this);
}

std::vector<std::shared_ptr<SceneHandle>> SceneHandle::all() {
    const std::scoped_lock lock(livingMutex);
    std::vector<std::shared_ptr<SceneHandle>> found;
    for (SceneHandle* const handle : living)
        if (auto shared = handle->weak_from_this().lock()) found.push_back(std::move(shared));
    return found;
}

Scene& SceneHandle::scene() const {
    if (!scene_) raise(DiagnosticCode("application"), "the scene is closed", "Closed");
    if (!scene_->isOwnThread())
        raise(DiagnosticCode("wrong-thread"), "the scene belongs to the thread that made it; this is another one");
    return *scene_;
}

Scene& SceneHandle::between() const {
    Scene& inside = scene();
    if (inside.isInFrame())
        raise(DiagnosticCode("from-within"),
              "within a frame a node's functions read fields, and emit those of their node; all else waits until it is "
              "over");
    return inside;
}

Scene& SceneHandle::edited() const {
    Scene& inside = between();
    if (readOnly_)
        raise(DiagnosticCode("access"),
              "this scene follows another one, or a log, and is not edited here; Follower.edit() and send() ask the "
              "origin");
    return inside;
}

void SceneHandle::refuseFromWithin(const char* what) const {
    if (within_ > 0)
        raise(DiagnosticCode("from-within"),
              fmt::format("{} from within a frame, or another call that goes on with the scene afterwards", what));
}

void SceneHandle::close() {
    if (!scene_) return;
    (void)scene();
    refuseFromWithin("a scene is not closed");
    // With the lock where it may not be given away any more: when the interpreter ends.
    if (mayWork())
        unlocked([&] { endDependents(); });
    else
        endDependents();
    report();
    end();
}

void SceneHandle::own(std::shared_ptr<Dependent> dependent) {
    add(*dependent);
    owned_.push_back(std::move(dependent));
}

void SceneHandle::remove(Dependent& dependent) {
    std::erase(dependents_, &dependent);
    std::erase_if(owned_, [&](const auto& one) { return one.get() == &dependent; });
}

void SceneHandle::endDependents() noexcept {
    while (!dependents_.empty()) {
        Dependent* const last = dependents_.back();
        dependents_.pop_back();
        last->end();
    }
    owned_.clear();
}

void SceneHandle::end() noexcept {
    if (!scene_) return;
    endDependents();
    clear();
    measured_.reset();
    light_.reset();
    if (queries_) scene_->setSpaceQueries(nullptr);
    queries_.reset();
    world_.reset();
    physics_.reset();
    inlines_.reset();
    scene_->bus().setReporter({});
    scene_ = nullptr;
    keeper_.reset();
}

void SceneHandle::abandon() noexcept {
    if (!scene_) return;
    for (Dependent* const dependent : dependents_) dependent->abandon();
    dependents_.clear();
    owned_.clear();
    (void)measured_.release();
    (void)light_.release();
    (void)queries_.release();
    (void)world_.release();
    (void)physics_.release();
    (void)inlines_.release();
    // Nobody ever lets go of these: their threads are gone.
    for (const auto& subscription : subscriptions_) subscription->leave();
    (void)new auto(std::move(subscriptions_));
    (void)new auto(std::move(keeper_));
    subscriptions_.clear();
    scene_ = nullptr;
}

// ---- running -------------------------------------------------------------------------------------------------------

void SceneHandle::follow() {
    BuildOptions build;
    build.resources = options_.resources;
    build.file = options_.file;
    build.mediaLength = [maximum = options_.resources.policy().maximumSamples](const Resource& file) {
        return mediaSeconds(file, maximum);
    };
    inlines_ = std::make_unique<InlineLoader>(*scene_, inlineDiagnostics_, build);
    inlines_->measureTexts(measureText, InlineLoader::Texts::heard);
    queries_ = std::make_unique<WorldQueries>([this]() -> SharedWorld& { return world(); }, options_.resources);
    scene_->setSpaceQueries(queries_.get());
    scene_->setNavigation(true);
    physics_ = std::make_unique<RigidBodyPhysics>(*scene_);
}

std::shared_ptr<const ChangeSet> SceneHandle::frame(double t) {
    Scene& s = edited();
    if (!std::isfinite(t)) raise(DiagnosticCode("cascade"), fmt::format("{} is no time", t));
    if (t < s.now() && (ran_ || s.now() != 0))
        raise(DiagnosticCode("cascade"), fmt::format("time cannot go back from {} to {}", s.now(), t));
    ran_ = true;
    auto set = work([&] {
        for (std::size_t i = 0; i < dependents_.size(); ++i) dependents_[i]->beforeFrame();
        auto created = s.newFrame(t);
        if (inlines_ && inlines_->update() > 0) s.seal();
        return created;
    });
    raisePending();
    report();
    if (set->to == 0)
        raise(DiagnosticCode("from-within"), "the frame was refused: too many came from within one delivery");
    return set;
}

std::shared_ptr<const ChangeSet> SceneHandle::seal() {
    Scene& s = edited();
    auto set = work([&] { return s.seal(); });
    raisePending();
    report();
    return set;
}

SharedWorld& SceneHandle::world() {
    if (!world_) world_ = std::make_unique<SharedWorld>(*scene_, worldOptions(options_.resources));
    return *world_;
}

LightRenderer& SceneHandle::light() {
    if (!light_) light_ = std::make_unique<LightRenderer>(world(), LightRenderer::Options(options_.resources));
    return *light_;
}

static SharedWorld::Options cut(const Resources& resources, float ofRadius) {
    SharedWorld::Options options = worldOptions(resources);
    options.flattening.error.ofRadius = ofRadius;
    return options;
}

SceneHandle::Measured::Measured(SceneHandle& handle, float radius)
    : world(*handle.scene_, cut(handle.resources(), radius)), tracer(world, handle.resources()), ofRadius(radius) {
    world.add(tracer);
}

SceneHandle::Measured& SceneHandle::measured(float ofRadius) {
    if (!measured_ || measured_->ofRadius != ofRadius) {
        measured_.reset();
        measured_ = std::make_unique<Measured>(*this, ofRadius);
    }
    return *measured_;
}

// ---- subscribers and what is said ----------------------------------------------------------------------------------

std::shared_ptr<Subscription> SceneHandle::subscribe(py::function call) {
    auto subscription = std::make_shared<Subscription>(*this, std::move(call));
    subscriptions_.push_back(subscription);
    work([&] { subscription->begin(); });
    raisePending();
    return subscription;
}

void SceneHandle::forget(const Subscription& subscription) {
    std::erase_if(subscriptions_, [&](const auto& one) { return one.get() == &subscription; });
}

void SceneHandle::keep(py::error_already_set error) {
    pending_.push_back(std::move(error));
}

void SceneHandle::raisePending() {
    if (pending_.empty()) return;
    // Those that failed are detached; a function that is called no more is not held either.
    std::vector<std::shared_ptr<Subscription>> failed;
    std::ranges::copy_if(subscriptions_, std::back_inserter(failed),
                         [](const auto& one) { return !one->error().is_none(); });
    for (const auto& one : failed) one->end();
    py::error_already_set first = std::move(pending_.front());
    pending_.clear();  // each is in the `error` of its Subscription
    {
        const std::scoped_lock lock(reports_->mutex);
        reports_->failures.clear();
    }
    throw first;
}

void SceneHandle::takeFailures() {
    std::vector<Diagnostic> failures;
    {
        const std::scoped_lock lock(reports_->mutex);
        failures.swap(reports_->failures);
    }
    for (Diagnostic& failure : failures) said_.add(std::move(failure));
}

void SceneHandle::report() {
    if (!scene_) return;
    takeFailures();
    const auto& ofScene = scene_->diagnostics().all();
    for (; reportedOfScene_ < ofScene.size(); ++reportedOfScene_) said_.add(ofScene[reportedOfScene_]);
    if (!inlineDiagnostics_.all().empty()) {
        said_.append(inlineDiagnostics_);
        inlineDiagnostics_ = Diagnostics(options_.file.string());
    }
    const std::size_t before = std::exchange(reported_, said_.all().size());
    for (std::size_t i = before; i < said_.all().size(); ++i)
        if (said_.all()[i].severity != Severity::note) warn(said_.all()[i].format());
}

void SceneHandle::note(const Diagnostic& failure) {
    const std::scoped_lock lock(reports_->mutex);
    reports_->failures.push_back(failure);
}

int SceneHandle::traverse(visitproc visit, void* arg) {
    for (const auto& subscription : subscriptions_) Py_VISIT(subscription->call().ptr());
    for (const auto& behaviour : behaviours_) {
        Py_VISIT(behaviour->onTime.ptr());
        Py_VISIT(behaviour->onEvent.ptr());
    }
    return 0;
}

void SceneHandle::clear() {
    // Letting go of a function may end the last owner of anything.
    const auto ended = std::exchange(subscriptions_, {});
    for (const auto& subscription : ended) subscription->end();
    std::vector<py::function> functions;
    for (const auto& behaviour : behaviours_) {
        functions.push_back(std::exchange(behaviour->onTime, {}));
        functions.push_back(std::exchange(behaviour->onEvent, {}));
    }
    pending_.clear();
}

py::object objectOf(SceneHandle& handle) {
    return py::cast(handle.shared_from_this());
}

}  // namespace rtsg::python
