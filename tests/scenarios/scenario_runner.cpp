// Runs a scenario directly, replayed, mirrored, by a late joiner and by its inputs alone.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <map>
#include <memory>
#include <set>

#include <fmt/format.h>
#include <unistd.h>

#include <rtsg/core/dis_input.h>
#include <rtsg/core/field_text.h>
#include <rtsg/core/navigation.h>
#include <rtsg/documents/loader.h>
#include <rtsg/documents/scene_builder.h>
#include <rtsg/physics/rigid_body_physics.h>
#include <rtsg/scripts/run_scripts.h>
#include <rtsg/sync/change_codec.h>

#include "scenario.h"
#include "support/simple_space.h"
#include "sync/codec/input_wire.h"

namespace rtsg::test {

namespace {

// ---- values ----------------------------------------------------------------------------------------------------

constexpr double kTolerance = 1e-5;

template <class S>
bool nearNumbers(const S* a, const S* b, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
        const double x = static_cast<double>(a[i]), y = static_cast<double>(b[i]);
        if (!(x == y || std::abs(x - y) <= kTolerance * std::max({1.0, std::abs(x), std::abs(y)}))) return false;
    }
    return true;
}

bool near(const Value& a, const Value& b) {
    if (a.type() != b.type()) return false;
    const FieldType element = sf(a.type());
    const FieldTypeInfo& i = info(element);
    std::size_t count = 1;
    const void *x = a.storage(), *y = b.storage();
    if (isMF(a.type())) {
        const auto* left = *static_cast<detail::ArrayHeader* const*>(x);
        const auto* right = *static_cast<detail::ArrayHeader* const*>(y);
        count = left ? left->size : 0;
        if (count != (right ? right->size : 0)) return false;
        if (count == 0) return true;
        x = left + 1;
        y = right + 1;
    }
    const std::size_t numbers = count * i.components;
    const bool isDouble = i.components && i.elementSize / i.components == sizeof(double);
    const bool isFloat = i.components && i.elementSize / i.components == sizeof(float) && element != FieldType::SFInt32;
    if (isDouble) return nearNumbers(static_cast<const double*>(x), static_cast<const double*>(y), numbers);
    if (isFloat) return nearNumbers(static_cast<const float*>(x), static_cast<const float*>(y), numbers);
    return a == b;
}

std::vector<std::string> wordsOf(const std::string& text) {
    std::vector<std::string> words;
    std::string word;
    for (const char c : text + ' ') {
        if (c == ' ' || c == '\t' || c == '\n' || c == ',' || c == '[' || c == ']') {
            if (!word.empty()) words.push_back(std::exchange(word, {}));
        } else {
            word += c;
        }
    }
    return words;
}

std::pair<std::string, std::string> splitFirst(const std::string& text) {
    const std::size_t end = text.find_first_of(" \t\n");
    if (end == std::string::npos) return {text, {}};
    const std::size_t rest = text.find_first_not_of(" \t\n", end);
    return {text.substr(0, end), rest == std::string::npos ? std::string() : text.substr(rest)};
}

// ---- transport ---------------------------------------------------------------------------------------------------

/// A set as it comes out at the other end of the wire.
std::shared_ptr<const ChangeSet> transported(const ChangeSet& set, std::string& problem) {
    ByteBuffer record;
    ChangeEncoder().encode(set, record);
    if (auto intact = checkRecord(record.bytes()); !intact) problem = intact.error().text;
    auto copy = std::make_shared<ChangeSet>();
    ChangeDecoder decoder(builtinTypes());
    if (auto decoded = decoder.decode(record.bytes(), *copy); !decoded) problem = decoded.error().text;
    return copy;
}

struct Event {
    NodeId node;
    FieldIndex field = kNoField;
    Value value;
};

class Run final : Subscriber {
  public:
    Run(const Scenario& scenario, Mode mode) : scenario_(scenario), mode_(mode) {
        folder_ = std::filesystem::temp_directory_path() /
                  fmt::format("rtsg-scenario-{}-{}", getpid(), static_cast<const void*>(this));
    }
    ~Run() override {
        std::error_code ignored;
        std::filesystem::remove_all(folder_, ignored);
    }

    std::string go() {
        begin(std::make_unique<Scene>());
        for (const Statement& one : scenario_.statements) {
            at_ = &one;
            step(one);
        }
        checkEvents();
        checkDiagnostics();
        return problems_;
    }

  private:
    template <class... T>
    void fail(fmt::format_string<T...> text, T&&... parts) {
        problems_ += fmt::format("{}:{}: ", scenario_.path.filename().string(), at_ ? at_->line : 0) +
                     fmt::format(text, std::forward<T>(parts)...) + '\n';
    }

    // ---- scenes: the one that runs, and those that follow it ---------------------------------------------------

    void begin(std::unique_ptr<Scene> scene) {
        inlines_.reset();
        attachment_.detach();
        physics_.reset();
        if (scene_) runtime_.append(scene_->diagnostics());
        physics_.reset();
        scene_ = std::move(scene);
        if (mode_ == Mode::input) {
            scene_->setInputRecording(true);
            copy_ = std::make_unique<Scene>();
            wire_ = std::make_unique<InputWire>(*copy_);
        }
        scene_->setEventListener([this](double, const Node& node, FieldIndex field, const Value& value) {
            if (node.type().fields[field].sends()) events_.push_back({node.id(), field, value});
        });
        space_ = std::make_unique<SimpleSpace>(*scene_);
        scene_->setSpaceQueries(space_.get());
        scene_->setNavigation(true);
        physics_ = std::make_unique<RigidBodyPhysics>(*scene_);
        runScripts(*scene_);
        scene_->setScriptResources(std::make_shared<const Resources>(folder_));
        BuildOptions options;
        options.resources = folder_;
        inlines_ = std::make_unique<InlineLoader>(*scene_, diagnostics_, options);
        attachment_ = scene_->bus().attach(*this);
    }

    Result<> apply(const Scene&, const ChangeSet& set) override {
        if (wire_)
            if (const std::string wrong = wire_->take(set); !wrong.empty()) fail("input: {}", wrong);
        std::string problem;
        const auto copy = transported(set, problem);
        if (!problem.empty()) fail("codec: {}", problem);
        if (followers_.empty()) followers_.push_back(std::make_unique<Scene>());
        for (auto& follower : followers_) {
            follower->setBehavioursEnabled(false);
            if (follower->sequence() >= set.to) continue;  // the scene was replaced by its equal, and attached again
            if (auto applied = follower->apply(copy); !applied) fail("apply: {}", applied.error().text);
        }
        return {};
    }

    void compare(const Scene& other, const char* what) {
        if (other.hash() != scene_->hash())
            fail("{}: hash {} instead of {}", what, other.hash().hex(), scene_->hash().hex());
        if (other.dump() != scene_->dump())
            fail("{}: states differ\n{}---- instead of\n{}", what, other.dump(), scene_->dump());
    }

    void frame(double t) {
        (void)scene_->newFrame(t);
        if (inlines_->update() > 0) scene_->seal();
        sent_ = false;
        now_ = t;
        for (const auto& follower : followers_) compare(*follower, "follower");
        if (copy_) compare(*copy_, "run from inputs");
        if (mode_ == Mode::direct || mode_ == Mode::mirrored || mode_ == Mode::input) return;
        std::string problem;
        const auto snapshot = transported(scene_->snapshot(), problem);
        auto fresh = std::make_unique<Scene>();
        if (auto applied = fresh->apply(snapshot); !applied) problem += applied.error().text;
        if (!problem.empty()) fail("snapshot: {}", problem);
        compare(*fresh, "snapshot");
        if (mode_ == Mode::late) {
            fresh->setBehavioursEnabled(false);
            followers_.push_back(std::move(fresh));
        } else {
            begin(std::move(fresh));
        }
    }

    /// The scene that answers `get`.
    const Scene& observed() const {
        if (copy_) return *copy_;
        const bool replica = (mode_ == Mode::mirrored || mode_ == Mode::late) && !followers_.empty();
        return replica ? *followers_.back() : *scene_;
    }

    // ---- names -------------------------------------------------------------------------------------------------

    static NodeId resolve(const Scene& scene, const std::string& path) {
        NodeId scope;
        for (std::size_t from = 0;;) {
            const std::size_t slash = path.find('/', from);
            scope = scene.findName(path.substr(from, slash - from), scope);
            if (!scope || slash == std::string::npos) return scope;
            from = slash + 1;
        }
    }
    std::string pathOf(NodeId id) const {
        const Node* node = scene_->find(id);
        if (!node || scene_->name(id).empty()) return {};
        if (!node->scope()) return std::string(scene_->name(id));
        const std::string outer = pathOf(node->scope());
        return outer.empty() ? outer : outer + '/' + std::string(scene_->name(id));
    }
    bool resolveField(const Scene& scene, const std::string& text, NodeId& node, FieldIndex& field) {
        const std::size_t dot = text.rfind('.');
        node = dot == std::string::npos ? NodeId{} : resolve(scene, text.substr(0, dot));
        if (!node) {
            fail("no node '{}'", text);
            return false;
        }
        const std::string name = text.substr(dot + 1);  // a hidden one begins with _
        field = name.starts_with('_') ? scene.node(node).type().findExact(name) : scene.node(node).type().find(name);
        if (field == kNoField) fail("no field '{}'", text);
        return field != kNoField;
    }
    bool parseValue(const Scene& scene, FieldType type, const std::string& text, Value& value) {
        if (sf(type) == FieldType::SFNode) {
            Array<NodeId> nodes;
            for (const std::string& name : wordsOf(text)) {
                if (name == "NULL") continue;
                const NodeId id = resolve(scene, name);
                if (!id) fail("no node '{}'", name);
                nodes.push_back(id);
            }
            if (type == FieldType::MFNode)
                value = Value(nodes);
            else
                value = Value(nodes.empty() ? NodeId{} : nodes[0]);
            return true;
        }
        auto parsed = parseFieldText(type, text);
        if (!parsed) {
            fail("'{}' is no {}: {}", text, info(type).name, parsed.error().text);
            return false;
        }
        value = *parsed;
        return true;
    }
    std::string print(const Value& value) const {
        if (value.holds<NodeId>()) return pathOf(value.as<NodeId>());
        if (!value.holds<Array<NodeId>>()) return printFieldText(value);
        std::string text = "[";
        for (const NodeId id : value.as<Array<NodeId>>()) text += ' ' + pathOf(id);
        return text + " ]";
    }

    // ---- statements --------------------------------------------------------------------------------------------

    /// [N:] [down|up] [X Y Z DX DY DZ|picture X Y|leave]; what is left out is as it was.
    void point(const std::vector<std::string>& words) {
        std::size_t i = 0;
        PointerInput given;
        if (i < words.size() && words[i].ends_with(':')) given.device = std::atoi(words[i++].c_str());
        PointerInput& input = pointers_[given.device];
        input.device = given.device;
        if (i < words.size() && (words[i] == "down" || words[i] == "up"))
            input.buttons = words[i++] == "down" ? PointerInput::kPrimary : 0;
        if (i < words.size() && words[i] == "leave") {
            input.kind = PointerInput::Kind::absent;
            ++i;
        } else if (i + 3 == words.size() && words[i] == "picture") {
            input.kind = PointerInput::Kind::picture;
            input.x = std::strtod(words[i + 1].c_str(), nullptr);
            input.y = std::strtod(words[i + 2].c_str(), nullptr);
            i += 3;
        } else if (i + 6 == words.size()) {
            double numbers[6];
            for (double& number : numbers) number = std::strtod(words[i++].c_str(), nullptr);
            input.kind = PointerInput::Kind::ray;
            input.origin = {numbers[0], numbers[1], numbers[2]};
            input.direction = {numbers[3], numbers[4], numbers[5]};
        }
        if (i < words.size()) return fail("what is '{}'?", words[i]);
        if (auto ok = sendPointer(*scene_, input); !ok) fail("{}", ok.error().text);
        sent_ = true;
    }
    void press(const std::vector<std::string>& words) {
        const bool up = words[0] == "up";
        const auto key = KeyInput::named(words.back(), !up);
        auto ok = key ? sendKey(*scene_, *key) : Result<>(std::unexpected(key.error()));
        if (!ok) fail("{}", ok.error().text);
        sent_ = true;
    }

    /// NODE and the bytes of PDUs, one after the other.
    void hearBytes(const std::string& name, const std::string& text) {
        HeardPdu pdu{resolve(*scene_, name), false, {}};
        if (!pdu.node) return fail("no node '{}'", name);
        for (const std::string& word : wordsOf(text))
            for (std::size_t i = 0; i + 1 < word.size(); i += 2)
                pdu.bytes.push_back(static_cast<std::uint8_t>(std::stoi(word.substr(i, 2), nullptr, 16)));
        if (auto ok = hear(*scene_, {&pdu, 1}); !ok) fail("{}", ok.error().text);
        sent_ = true;
    }

    /// False if the statement is of no device.
    bool useDevice(const Statement& one) {
        if (one.verb == "pointer") {
            point(wordsOf(one.text));
        } else if (one.verb == "key") {
            press(wordsOf(one.text));
        } else if (one.verb == "text") {
            std::string text = one.text;
            for (std::size_t at; (at = text.find("\\n")) != std::string::npos;) text.replace(at, 2, "\n");
            if (auto ok = sendText(*scene_, text); !ok) fail("{}", ok.error().text);
            sent_ = true;
        } else if (one.verb == "hear") {
            const auto [node, bytes] = splitFirst(one.text);
            hearBytes(node, bytes);
        } else if (one.verb == "wheel") {
            const std::vector<std::string> words = wordsOf(one.text);
            if (words.size() != 2) return fail("a wheel turns ACROSS DOWN"), true;
            auto ok =
                sendWheel(*scene_, std::strtod(words[0].c_str(), nullptr), std::strtod(words[1].c_str(), nullptr));
            if (!ok) fail("{}", ok.error().text);
            sent_ = true;
        } else {
            return false;
        }
        return true;
    }

    /// Where the viewer is, in world coordinates.
    void checkViewer(const std::string& text) {
        const auto wanted = parseFieldText(FieldType::MFFloat, '[' + text + ']');
        const ViewerPose pose = viewerPose(observed());
        const Vec3d& p = pose.position;
        const Vec3d ahead = pose.orientation * Vec3d(0, 0, -1);
        Array<float> actual;
        for (const double number : {p.x, p.y, p.z, ahead.x, ahead.y, ahead.z}) actual.push_back(float(number));
        if (wanted && wanted->as<Array<float>>().size() == 3) actual.resize(3);
        if (!wanted || !near(*wanted, Value(actual)))
            fail("the viewer is at {}, not {}", printFieldText(Value(actual)), text);
    }

    static bool isExpectation(const std::string& verb) {
        static const std::set<std::string> all{"expect", "ordered",    "silent", "get",
                                               "absent", "diagnostic", "viewer", "----"};
        return all.contains(verb);
    }

    void step(const Statement& one) {
        const std::string& verb = one.verb;
        if (!isExpectation(verb)) checkEvents();
        if (useDevice(one)) return;
        NodeId node, other;
        FieldIndex field = kNoField, otherField = kNoField;
        Value value;
        const auto [first, rest] = splitFirst(one.text);
        if (verb == "scene" || verb == "create") {
            if (!loadText(*scene_, "#X3D V4.0 utf8\n" + one.text, diagnostics_, folder_)) fail("the scene is unusable");
        } else if (verb == "file") {
            std::filesystem::create_directories(folder_);
            std::ofstream(folder_ / first) << "#X3D V4.0 utf8\n" << rest << '\n';
        } else if (verb == "watch") {
            for (const std::string& name : wordsOf(one.text))
                if (resolveField(*scene_, name, node, field)) watched_.emplace(node.value, field);
        } else if (verb == "send" || verb == "set") {
            if (!resolveField(*scene_, first, node, field)) return;
            if (!parseValue(*scene_, scene_->node(node).type().fields[field].type, rest, value)) return;
            const auto done =
                verb == "send" ? scene_->sendEvent(node, field, value) : scene_->setField(node, field, value);
            if (!done) fail("{}", done.error().text);
            sent_ = true;
        } else if (verb == "time") {
            for (const std::string& word : wordsOf(one.text)) {
                double t = 0;
                std::from_chars(word.data(), word.data() + word.size(), t);
                frame(t);
            }
        } else if (verb == "route" || verb == "unroute") {
            const std::vector<std::string> words = wordsOf(one.text);
            if (words.size() != 3 || words[1] != "TO") return fail("route A.x TO B.y");
            if (!resolveField(*scene_, words[0], node, field) || !resolveField(*scene_, words[2], other, otherField))
                return;
            const auto done = verb == "route" ? scene_->addRoute(node, field, other, otherField)
                                              : scene_->removeRoute(node, field, other, otherField);
            if (!done) fail("{}", done.error().text);
        } else if (verb == "add" || verb == "remove") {
            if (!resolveField(*scene_, first, node, field)) return;
            other = resolve(*scene_, rest);
            const Array<NodeId> children = scene_->node(node).value(field).as<Array<NodeId>>();
            const auto found = std::ranges::find(children, other);
            if (verb == "remove" && found == children.end()) return fail("no child '{}'", rest);
            const auto done = verb == "add" ? scene_->insertChild(node, field, other)
                                            : scene_->removeChild(node, field, std::size_t(found - children.begin()));
            if (!done) fail("{}", done.error().text);
            sent_ = true;
        } else if (verb == "destroy") {
            node = resolve(*scene_, first);
            if (auto done = scene_->destroyNode(node); !done) fail("{}", done.error().text);
            sent_ = true;
        } else if (verb == "----") {
            checkEvents();
            if (sent_) frame(now_);
            expecting_ = true;
            expected_.clear();
            ordered_ = silent_ = false;
        } else if (verb == "expect") {
            if (!resolveField(*scene_, first, node, field)) return;
            if (!parseValue(*scene_, scene_->node(node).type().fields[field].type, rest, value)) return;
            expected_.push_back({node, field, value});
        } else if (verb == "ordered") {
            ordered_ = true;
        } else if (verb == "silent") {
            silent_ = true;
        } else if (verb == "get") {
            const Scene& scene = observed();
            if (!resolveField(scene, first, node, field)) return;
            if (!parseValue(scene, scene.node(node).type().fields[field].type, rest, value)) return;
            const Value actual = scene.node(node).value(field);
            if (!near(actual, value)) fail("{} is {}, not {}", first, print(actual), print(value));
        } else if (verb == "viewer") {
            checkViewer(one.text);
        } else if (verb == "absent") {
            if (resolve(observed(), first)) fail("'{}' is still there", first);
        } else if (verb == "diagnostic") {
            expectedDiagnostics_.push_back(one.text);
        }
    }

    void checkEvents() {
        if (!expecting_) return;
        expecting_ = false;
        std::vector<Event> actual;
        for (Event& event : events_) {
            const bool counts =
                watched_.empty() ? !pathOf(event.node).empty() : watched_.contains({event.node.value, event.field});
            if (counts) actual.push_back(std::move(event));
        }
        events_.clear();
        // A block that only looks at state says nothing of events.
        if (expected_.empty() && !silent_) return;
        const auto show = [&](const Event& e) {
            return fmt::format("{}.{} {}", pathOf(e.node), scene_->node(e.node).type().fields[e.field].name,
                               print(e.value));
        };
        const auto same = [](const Event& a, const Event& b) {
            return a.node == b.node && a.field == b.field && near(a.value, b.value);
        };
        if (ordered_ && actual.size() == expected_.size() && std::ranges::equal(actual, expected_, same)) return;
        std::string all;
        for (const Event& e : actual) all += "\n    " + show(e);
        if (ordered_) return fail("events came in another order or with other values:{}", all);
        std::vector<bool> used(actual.size());
        for (const Event& wanted : expected_) {
            std::size_t i = 0;
            while (i < actual.size() && (used[i] || !same(actual[i], wanted))) ++i;
            if (i == actual.size())
                fail("missing event {}; events were:{}", show(wanted), all);
            else
                used[i] = true;
        }
        for (std::size_t i = 0; i < actual.size(); ++i)
            if (!used[i]) fail("unexpected event {}", show(actual[i]));
    }

    void checkDiagnostics() {
        runtime_.append(scene_->diagnostics());
        std::vector<Diagnostic> all = diagnostics_.all();
        all.insert(all.end(), runtime_.all().begin(), runtime_.all().end());
        std::vector<bool> wanted(all.size());
        for (const std::string& text : expectedDiagnostics_) {
            bool found = false;
            for (std::size_t i = 0; i < all.size(); ++i)
                if (all[i].format().find(text) != std::string::npos) found = wanted[i] = true;
            if (!found) fail("no diagnostic says '{}'", text);
        }
        for (std::size_t i = 0; i < all.size(); ++i)
            if (!wanted[i] && all[i].severity == Severity::error) fail("{}", all[i].format());
    }

    const Scenario& scenario_;
    Mode mode_;
    const Statement* at_ = nullptr;
    std::filesystem::path folder_;
    std::string problems_;
    Diagnostics diagnostics_{"scene"}, runtime_;
    std::unique_ptr<SimpleSpace> space_;
    std::map<std::int32_t, PointerInput> pointers_;
    std::unique_ptr<Scene> scene_;
    std::unique_ptr<RigidBodyPhysics> physics_;  // the scene outlives it
    std::vector<std::unique_ptr<Scene>> followers_;
    std::unique_ptr<Scene> copy_;  // computes the frames itself
    std::unique_ptr<InputWire> wire_;
    std::unique_ptr<InlineLoader> inlines_;
    Attachment attachment_;
    std::vector<Event> events_, expected_;
    std::set<std::pair<std::uint32_t, FieldIndex>> watched_;
    std::vector<std::string> expectedDiagnostics_;
    bool expecting_ = false, ordered_ = false, silent_ = false, sent_ = false;
    double now_ = 0;
};

}  // namespace

std::string runScenario(const Scenario& scenario, Mode mode) {
    if (!scenario.error.empty()) return scenario.path.filename().string() + ": " + scenario.error + '\n';
    return Run(scenario, mode).go();
}

}  // namespace rtsg::test
