// Binds servers of scenes and followers of scenes that are served elsewhere.
#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include <rtsg/core/field_path.h>
#include <rtsg/nats/mirror_origin.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>

#include "changes.h"
#include "collected.h"
#include "errors.h"
#include "module.h"
#include "unlocked.h"
#include "values.h"

namespace py = pybind11;

namespace rtsg::python {

namespace {

using Milliseconds = std::chrono::milliseconds;
/// How long a wait goes on before signals are looked at.
constexpr Milliseconds kSlice{50};

Milliseconds millisecondsOf(double seconds) {
    return Milliseconds(static_cast<std::int64_t>(std::min(seconds, 1e9) * 1e3));
}

std::optional<MirrorKeys> keysFrom(const std::string& file) {
    if (file.empty()) return std::nullopt;
    return take(MirrorKeys::load(file));
}

void warnOf(const std::vector<Diagnostic>& all) {
    for (const Diagnostic& one : all)
        if (one.severity != Severity::note) warn(one.format());
}

// ---- servers -------------------------------------------------------------------------------------------------------

/// The scene keeps it until it is closed.
class Server final : public Dependent {
  public:
    Server(SceneHandle& handle, std::unique_ptr<MirrorServer> server) : handle_(&handle), server_(std::move(server)) {}

    void end() noexcept override { server_.reset(); }
    void abandon() noexcept override { (void)server_.release(); }
    void beforeFrame() override {
        if (server_) server_->service();
    }
    static void close(const std::shared_ptr<Server>& self) {
        if (!self->server_) return;
        (void)self->handle_->scene();
        self->handle_->refuseFromWithin("a server is not closed");
        self->handle_->remove(*self);
        unlocked([&] { self->server_.reset(); });
    }
    SceneHandle& handle() const {
        (void)server();
        return *handle_;
    }
    MirrorServer& server() const {
        if (!server_) raise(DiagnosticCode("application"), "the server is closed", "Closed");
        (void)handle_->scene();
        return *server_;
    }
    bool drain(double seconds) {
        MirrorServer& inside = server();
        const auto until = std::chrono::steady_clock::now() + millisecondsOf(seconds);
        while (true) {
            const auto left = std::chrono::duration_cast<Milliseconds>(until - std::chrono::steady_clock::now());
            const bool done = handle_->work([&] { return inside.drain(std::clamp(left, Milliseconds(0), kSlice)); });
            if (PyErr_CheckSignals() != 0) throw py::error_already_set();
            if (done || left <= Milliseconds(0)) return done;
        }
    }
    /// Sleeps until then, on the steady clock, or until a peer asks for something.
    void wait(double seconds) {
        MirrorServer& inside = server();
        const auto until = std::chrono::steady_clock::now() + millisecondsOf(seconds);
        handle_->work([&] { inside.wait(until); });
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    }
    void report() { warnOf(server().takeDiagnostics()); }

  private:
    SceneHandle* handle_;  // good while there is a server
    std::unique_ptr<MirrorServer> server_;
};

std::shared_ptr<Server> serve(SceneHandle& handle, const std::string& endpoint, const std::string& upstream,
                              const std::string& keys, bool insecure, std::size_t peers) {
    MirrorServerOptions options;
    options.creator = "rtsg python";
    options.keys = keysFrom(keys);
    options.insecure = insecure;
    options.maximumPeers = peers;
    const auto may = mirrorUpstreamFromName(upstream);
    if (!may)
        throw py::value_error("upstream is \"none\", \"events\", \"edits\" or \"code\", not \"" + upstream + "\"");
    options.upstream = *may;
    Scene& inside = handle.between();
    auto started = handle.work([&] { return MirrorServer::start(inside, endpoint, std::move(options)); });
    handle.raisePending();
    auto server = std::make_shared<Server>(handle, take(std::move(started)));
    handle.own(server);
    return server;
}

py::dict serverStatistics(const Server& server) {
    const MirrorServerStatistics s = server.server().statistics();
    py::dict all;
    all["peers"] = s.peers, all["frames"] = s.frames, all["bytes"] = s.bytes, all["snapshots"] = s.snapshots;
    all["merged"] = s.merged, all["refused"] = s.refused, all["requests"] = s.requests;
    all["acknowledged"] = s.acknowledged, all["sequence"] = s.sequence;
    return all;
}

// ---- followers -----------------------------------------------------------------------------------------------------

class Follower final : public Dependent {
  public:
    Follower(const std::string& endpoint, const std::string& name, const std::string& keys,
             const std::vector<std::string>& parts, double latency, const std::string& base) {
        SceneHandle::Options options;
        origin_ = take(unlocked([&] { return MirrorOrigin::open(endpoint); }));
        options.file = origin_->shown();
        if (!base.empty()) {
            ResourcePolicy policy;
            policy.roots.emplace_back(base);
            options.resources = Resources(base, policy);
        }
        const auto created = SceneHandle::makeReplica(std::move(options));
        handle_ = created.get();
        scene_ = py::cast(created);
        MirrorClientOptions how;
        how.name = name;
        how.keys = keysFrom(keys);
        how.parts = parts;
        how.latency = millisecondsOf(latency);
        take(origin_->prepare(how));
        client_ = take(MirrorClient::connect(handle_->scene(), origin_->endpoint(), std::move(how)));
        attachment_ = handle_->scene().bus().attach(pending_);
        pending_.sets.clear();  // of the empty scene
        handle_->add(*this);
    }
    ~Follower() override {
        if (!client_) return;
        handle_->remove(*this);
        end();
    }
    Follower(const Follower&) = delete;
    Follower& operator=(const Follower&) = delete;

    void end() noexcept override {
        attachment_.detach();
        client_.reset();
    }
    void abandon() noexcept override {
        (void)client_.release();
        (void)new auto(std::move(attachment_));
    }
    void close() {
        if (!client_) return;
        (void)handle_->scene();
        handle_->refuseFromWithin("a connection is not closed");
        handle_->remove(*this);
        unlocked([&] { end(); });
    }
    MirrorClient& client() const {
        if (!client_) raise(DiagnosticCode("application"), "the connection is closed", "Closed");
        (void)handle_->scene();
        return *client_;
    }

    /// Applies the records that have arrived, after waiting for at most this many seconds.
    py::list poll(double seconds) {
        MirrorClient& inside = client();
        handle_->refuseFromWithin("a follower is not asked for news");
        const auto until = std::chrono::steady_clock::now() + millisecondsOf(seconds);
        while (true) {
            const auto left = std::chrono::duration_cast<Milliseconds>(until - std::chrono::steady_clock::now());
            handle_->work([&] { inside.poll(std::clamp(left, Milliseconds(0), kSlice)); });
            if (PyErr_CheckSignals() != 0) throw py::error_already_set();
            handle_->raisePending();
            takeVerdicts();
            warnOf(inside.takeDiagnostics());
            warnOf(origin_->takeDiagnostics());
            if (!inside.refusal().empty()) raise(DiagnosticCode("mirror"), "the server refuses: " + inside.refusal());
            if (!pending_.sets.empty() || !verdicts_.empty() || left <= Milliseconds(0) || inside.serverLeft()) break;
        }
        py::list result;
        for (auto& set : std::exchange(pending_.sets, {})) result.append(toPython(std::move(set), scene_));
        return result;
    }
    py::list verdicts() {
        py::list all;
        const py::object verdict = py::module_::import("rtsg._types").attr("Verdict");
        for (const MirrorVerdict& one : std::exchange(verdicts_, {})) {
            py::dict created;
            for (const auto& [asked, now] : one.created) created[py::int_(asked.value)] = now.value;
            all.append(verdict(one.request, one.refusal, one.state, created, one.kept));
        }
        return all;
    }

    std::uint64_t ask(const std::string& path, const py::object& value, bool asEvent) {
        MirrorClient& inside = client();
        const Scene& replica = handle_->scene();
        const auto at = findField(replica, path);
        if (!at) raise(at.error(), "NoSuchName");
        const FieldDef& def = replica.node(at->node).type().fields[at->field];
        Value created = fromPython(def, value, *handle_, path);
        return take(asEvent ? inside.submitEvent(at->node, at->field, std::move(created))
                            : inside.submitEdit(at->node, at->field, std::move(created)));
    }
    std::uint64_t lock(const std::vector<std::string>& paths, double seconds) {
        std::vector<NodeId> nodes;
        for (const std::string& path : paths) {
            const auto found = findNode(handle_->scene(), path);
            if (!found) raise(found.error(), "NoSuchName");
            nodes.push_back(*found);
        }
        return take(client().lock(std::move(nodes), millisecondsOf(seconds)));
    }
    py::object presented(const std::string& path) const {
        const auto at = findField(handle_->scene(), path);
        if (!at) raise(at.error(), "NoSuchName");
        return toPython(client().presented(at->node, at->field), scene_);
    }
    const py::object& scene() const { return scene_; }

    int traverse(visitproc visit, void* arg) {
        Py_VISIT(scene_.ptr());
        return 0;
    }
    void clear() {}

  private:
    /// Keeps the sets that a poll brings.
    struct Pending final : Subscriber {
        Result<> apply(const Scene&, const ChangeSet& changes) override {
            sets.push_back(std::make_shared<const ChangeSet>(changes));
            return {};
        }
        std::string subscriberName() const override { return "follower"; }
        std::vector<std::shared_ptr<const ChangeSet>> sets;
    };

    void takeVerdicts() {
        for (MirrorVerdict& one : client_->takeVerdicts()) verdicts_.push_back(std::move(one));
    }

    py::object scene_;
    SceneHandle* handle_ = nullptr;
    Pending pending_;
    Attachment attachment_;
    std::optional<MirrorOrigin> origin_;
    std::unique_ptr<MirrorClient> client_;
    std::vector<MirrorVerdict> verdicts_;
};

/// The descriptors of which one becomes readable when poll() has something to do, and after how many seconds it has in
/// any case.
py::tuple waiting(const Follower& follower) {
    const MirrorClient::Waiting waiting = follower.client().waiting();
    py::list descriptors;
    for (const int descriptor : waiting.descriptors)
        if (descriptor >= 0) descriptors.append(descriptor);
    return py::make_tuple(descriptors, std::chrono::duration<double>(waiting.maximum).count());
}

py::dict followerStatistics(const Follower& follower) {
    const MirrorStatistics& s = follower.client().statistics();
    py::dict all;
    all["frames"] = s.frames, all["snapshots"] = s.snapshots, all["gaps"] = s.gaps, all["bytes"] = s.bytes;
    all["divergences"] = s.divergences, all["repairs"] = s.repairs, all["restarts"] = s.restarts;
    all["sequence"] = s.sequence, all["origin_sequence"] = s.originSequence, all["equal"] = s.equal;
    all["hash"] = s.hash.hex(), all["origin_hash"] = s.originHash.hex();
    all["lag_s"] = s.lag, all["delay_s"] = s.delay, all["holes"] = s.holes, all["missed_s"] = s.missed;
    return all;
}

void addServer(py::module_& module) {
    py::class_<Server, std::shared_ptr<Server>>(
        module, "Server", "A scene that is served, until this or the scene is closed; made by Scene.serve().")
        .def_property_readonly(
            "scene", [](const Server& s) { return objectOf(s.handle()); }, "The scene.")
        .def_property_readonly(
            "endpoint", [](const Server& s) { return s.server().endpoint(); }, "Where it listens, the port filled in.")
        .def_property_readonly("statistics", serverStatistics, "Peers, frames, bytes and so on, as a dict.")
        .def(
            "service",
            [](Server& s) {
                MirrorServer& inside = s.server();
                s.handle().work([&] { inside.service(); });
                s.handle().raisePending();
                s.report();
            },
            "Carries out what peers have asked for; Scene.frame() does it before each frame.")
        .def("wait", &Server::wait, py::arg("seconds"), "Sleeps so long, or until peers ask for something.")
        .def("drain", &Server::drain, py::arg("timeout") = 5.,
             "Waits until all peers have the scene's state; False if that takes more than `timeout` seconds.")
        .def("close", &Server::close, "Says goodbye to the peers.")
        .def("__enter__", [](py::object self) { return self; })
        .def("__exit__", [](const std::shared_ptr<Server>& s, const py::args&) { Server::close(s); });
    auto scene = py::class_<SceneHandle, std::shared_ptr<SceneHandle>>(module.attr("Scene"));
    scene.def(
        "serve", serve, py::arg("endpoint") = "tcp://127.0.0.1:*", py::kw_only(), py::arg("upstream") = "none",
        py::arg("keys") = "", py::arg("insecure") = false, py::arg("maximum_peers") = 64,
        "Serves the scene from now on: a Server. `upstream`: what peers may send: \"none\", \"events\", \"edits\" or "
        "\"code\". `keys`: a key file; without one other machines are let in only where `insecure` says so.");
}

void addFollower(py::module_& module) {
    py::class_<Follower>(module, "Follower", collected<Follower>(), "A scene that is served elsewhere, followed.")
        .def(py::init<const std::string&, const std::string&, const std::string&, const std::vector<std::string>&,
                      double, const std::string&>(),
             py::arg("endpoint"), py::kw_only(), py::arg("name") = "", py::arg("keys") = "",
             py::arg("parts") = std::vector<std::string>(), py::arg("latency") = 0., py::arg("base") = "")
        .def_property_readonly(
            "scene", [](const Follower& f) { return f.scene(); },
            "The replica, in the newest state that has come; it is read, pictured, saved like any scene.")
        .def("poll", &Follower::poll, py::arg("timeout") = 0.,
             "Applies what has come, after waiting for it at most `timeout` seconds: the ChangeSets, in order.")
        .def(
            "send", [](Follower& f, const std::string& p, const py::object& v) { return f.ask(p, v, true); },
            py::arg("path"), py::arg("value"),
            "Asks the origin for an event to \"NODE.field\". Returns the request's number.")
        .def(
            "edit", [](Follower& f, const std::string& p, const py::object& v) { return f.ask(p, v, false); },
            py::arg("path"), py::arg("value"), "Asks the origin to set \"NODE.field\". Returns the request's number.")
        .def(
            "undo", [](Follower& f) { return take(f.client().undo()); }, "Takes back what this follower did last.")
        .def(
            "redo", [](Follower& f) { return take(f.client().redo()); }, "Does again what was taken back last.")
        .def("lock", &Follower::lock, py::arg("nodes"), py::arg("seconds"),
             "Nobody else may change these nodes for so long, 60 s at most; 0 lets go of them.")
        .def("verdicts", &Follower::verdicts, "What became of requests since the last call: Verdict by Verdict.")
        .def("presented", &Follower::presented, py::arg("path"),
             "The value to show now, between two frames where there is a `latency`.")
        .def_property_readonly("_waiting", waiting)
        .def_property_readonly(
            "unanswered", [](const Follower& f) { return f.client().unanswered(); },
            "How many requests have no verdict yet.")
        .def_property_readonly(
            "in_step", [](const Follower& f) { return f.client().inStep(); },
            "The replica is in the newest state that was heard of.")
        .def_property_readonly(
            "origin_lost", [](const Follower& f) { return f.client().originLost(); }, "The origin is out of reach.")
        .def_property_readonly(
            "server_left", [](const Follower& f) { return f.client().serverLeft(); }, "The server said goodbye.")
        .def_property_readonly("statistics", followerStatistics, "Frames, bytes, lag, hashes and so on, as a dict.")
        .def("close", &Follower::close, "Ends the connection, and stays with the last state.")
        .def("__enter__", [](py::object self) { return self; })
        .def("__exit__", [](Follower& f, const py::args&) { f.close(); });
}

}  // namespace

void addMirrors(py::module_& module) {
    addServer(module);
    addFollower(module);
}

}  // namespace rtsg::python
