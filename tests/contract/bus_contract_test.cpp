// The bus's laws when the scene is edited from within, from each place that calls back: every subscriber sees every set
// in order, and what a set or a snapshot says is the state that its number stands for.
#include <functional>
#include <map>
#include <optional>

#include <gtest/gtest.h>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/x3d.h>
#include <rtsg/documents/loader.h>
#include <rtsg/scripts/run_scripts.h>

#include "support/long_form.h"
#include "support/random_edits.h"

namespace rtsg::test {
namespace {

enum class NodeField { immediate, polled, reporter, listener, onEvent, onTime, print };

std::string nameOf(NodeField position) {
    constexpr const char* names[] = {"ImmediateSubscriber", "PolledSubscriber", "ReporterOfTheBus", "EventListener",
                                     "BehaviourOnEvent",    "BehaviourOnTime",  "PrintOfAScript"};
    return names[static_cast<int>(position)];
}

using Hashes = std::map<std::uint64_t, Hash128>;  // by number of the state

/// Follows with a replica of its own; fails at once if a set does not go on from the one before.
struct Follower : Subscriber {
    Follower() { replica.setBehavioursEnabled(false); }
    Result<> apply(const Scene&, const ChangeSet& set) override {
        EXPECT_EQ(set.from, replica.sequence()) << name << ": a state was left out or came twice";
        EXPECT_EQ(set.isSnapshot(), sets++ == 0) << name;
        EXPECT_TRUE(merged || set.isSnapshot() || set.to == set.from + 1)
            << name << ": " << set.from << " to " << set.to;
        if (auto ok = replica.apply(std::make_shared<const ChangeSet>(set)); !ok) return ok;
        EXPECT_EQ(replica.hash(), set.hash) << name << ": state " << set.to;
        hashes[set.to] = set.hash;
        if (within) within();
        return {};
    }
    std::string subscriberName() const override { return name; }

    std::string name;
    bool merged = false;
    std::size_t sets = 0;
    Scene replica;
    Hashes hashes;
    std::function<void()> within;
};

/// Fails when told to, so that the bus reports it.
struct Failing : Subscriber {
    bool now = false;
    Result<> apply(const Scene&, const ChangeSet&) override { return now ? fail("told to") : Result<>{}; }
};

constexpr const char* kScene = R"(#X3D V4.0 utf8
PROFILE Full
DEF TOP Group {}
DEF ASKED Switch {}
DEF SEEN Transform {}
DEF S Script {
  inputOnly SFInt32 go
  initializeOnly SFNode top USE TOP
  initializeOnly SFNode seen USE SEEN
  directOutput TRUE
  url "ecmascript:
    var made = [];
    function go(n) {
      print(n);
      seen.translation = new SFVec3f(n, 0, 0);
      if (n % 3 == 0) {
        var one = Browser.currentScene.createNode('Transform');
        one.scale = new SFVec3f(n, 1, 1);
        top.children = new MFNode(one);
        Browser.addRoute(seen, 'translation_changed', one, 'set_translation');
        made.push(one);
      }
      if (n % 7 == 0) top.children = new MFNode();
    }"
}
)";

/// Someone meddles from one place, in the course of random edits, while subscribers of every kind follow.
class Meddling {
  public:
    Meddling(NodeField position, std::uint64_t seed) : field_(position), random_(seed) {
        ScriptOptions options;
        options.print = [this](std::string_view) { meddle(NodeField::print); };
        runScripts(scene_, std::move(options));
        scene_.setEventListener([this](double, const Node&, FieldIndex, const Value&) { meddle(NodeField::listener); });
        scene_.bus().setReporter([this](const Diagnostic&) { meddle(NodeField::reporter); });
        Diagnostics diagnostics;
        EXPECT_TRUE(loadText(scene_, kScene, diagnostics));
        EXPECT_EQ(diagnostics.errors(), 0U);
        registerBehaviour();
        edits_.emplace(scene_, seed, scene_.findName("TOP"));
        scene_.newFrame(0);

        early_.name = "early", late_.name = "late", polling_.name = "polling", drained_.name = "drained";
        polling_.merged = drained_.merged = true;
        meddler_.name = "meddler", meddler_.within = [this] { meddle(NodeField::immediate); };
        polling_.within = [this] { meddle(NodeField::polled); };
        for (Follower* one : {&early_, &meddler_, &late_}) attachments_.push_back(scene_.bus().attach(*one));
        failing_ = scene_.bus().attach(failingOne_);
        polled_ = scene_.bus().attach(polling_, Delivery::polled);
        drain_ = scene_.bus().attach(drained_, Delivery::polled);
    }
    ~Meddling() {
        current_ = nullptr;
        scene_.setEventListener({});
    }

    void run(int frames) {
        for (int i = 1; i <= frames; ++i) {
            left_ = 2;
            for (int n = pick(3); n > 0; --n) edits_->step();
            if (field_ == NodeField::reporter) {
                failing_ = {};
                failingOne_.now = false;
                failing_ = scene_.bus().attach(failingOne_);
                failingOne_.now = true;
            }
            const NodeId script = scene_.findName("S"), asked = scene_.findName("ASKED");
            ASSERT_TRUE(scene_.sendEvent(script, scene_.node(script).type().find("go"), std::int32_t{i}));
            ASSERT_TRUE(scene_.sendEvent(asked, x3d::Switch::whichChoice.index, std::int32_t{i}));
            scene_.newFrame(i);
            if (pick(4) == 0) polled_.poll();
            if (pick(8) == 0) drain_.drain();
        }
        left_ = 0;
        scene_.newFrame(frames + 1);  // what was edited last
        polled_.poll();
        drain_.drain();
    }

    void expectLaws() {
        for (const Follower* one : {&early_, &meddler_, &late_, &polling_, &drained_}) {
            EXPECT_EQ(one->replica.sequence(), scene_.sequence()) << one->name;
            EXPECT_EQ(one->replica.hash(), scene_.hash()) << one->name;
        }
        EXPECT_EQ(early_.hashes.size(), scene_.sequence()) << "a state nobody was told of";
        EXPECT_EQ(early_.hashes, late_.hashes);
        EXPECT_EQ(early_.hashes, meddler_.hashes);
        for (const auto& joined : joined_) EXPECT_EQ(joined->replica.hash(), scene_.hash()) << joined->name;
        for (const ChangeSet& snapshot : snapshots_) {
            Scene fresh;
            fresh.setBehavioursEnabled(false);
            ASSERT_TRUE(fresh.apply(std::make_shared<const ChangeSet>(snapshot)));
            EXPECT_EQ(fresh.hash(), early_.hashes.at(snapshot.to))
                << "the snapshot of state " << snapshot.to << " holds another";
        }
        EXPECT_TRUE(!betweenStates() || snapshots_.empty());
    }
    bool betweenStates() const { return field_ >= NodeField::listener; }
    std::uint64_t calls() const { return static_cast<std::uint64_t>(calls_); }
    std::uint64_t snapshots() const { return snapshots_.size(); }

  private:
    int pick(int count) { return static_cast<int>(random_() % static_cast<unsigned>(count)); }

    void registerBehaviour() {
        current_ = this;
        // Behaviours are plain functions: they find their test here.
        const Behaviour behaviour{
            .onEvent = [](Cascade&, const Node&, FieldIndex, EventValue) { current_->meddle(NodeField::onEvent); },
            .onTime = [](Cascade&, const Node&) -> double {
                if (current_) current_->meddle(NodeField::onTime);
                return 0;
            }};
        scene_.registerBehaviour(x3d::Switch::type, behaviour);
    }

    /// Called in every place; acts in one.
    void meddle(NodeField position) {
        if (position != field_ || left_ == 0 || inside_) return;
        --left_;
        ++calls_;
        inside_ = true;
        for (int n = 1 + pick(3); n > 0; --n) {
            edits_->step();
            if (pick(4) == 0) scene_.seal();
            if (pick(6) == 0) scene_.newFrame(scene_.now());  // refused inside a frame
            if (pick(4) == 0) takeSnapshot();
            if (pick(10) == 0) {
                auto& joined = joined_.emplace_back(std::make_unique<Follower>());
                joined->name = "joined from within";
                attachments_.push_back(scene_.bus().attach(*joined));
            }
        }
        inside_ = false;
    }
    void takeSnapshot() {
        ChangeSet snapshot = scene_.snapshot();
        if (snapshot.to == 0) return;  // refused
        EXPECT_EQ(snapshot.to, scene_.sequence());
        snapshots_.push_back(std::move(snapshot));
    }

    static inline Meddling* current_ = nullptr;
    NodeField field_;
    std::mt19937_64 random_;
    Scene scene_;
    std::optional<RandomEdits> edits_;
    int calls_ = 0, left_ = 0;
    bool inside_ = false;
    Follower early_, meddler_, late_, polling_, drained_;
    Failing failingOne_;
    std::vector<std::unique_ptr<Follower>> joined_;
    std::vector<ChangeSet> snapshots_;
    std::vector<Attachment> attachments_;
    Attachment failing_, polled_, drain_;
};

class BusContract : public testing::TestWithParam<NodeField> {};

TEST_P(BusContract, EverybodySeesEverySetInOrder) {
    std::uint64_t calls = 0, snapshots = 0;
    bool betweenStates = false;
    const std::uint64_t seeds = test::fewOrMany(10, 400);
    for (std::uint64_t seed = 1; seed <= seeds && !HasFailure(); ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        Meddling meddling(GetParam(), seed);
        ASSERT_NO_FATAL_FAILURE(meddling.run(40));
        meddling.expectLaws();
        calls += meddling.calls(), snapshots += meddling.snapshots(), betweenStates = meddling.betweenStates();
    }
    // Else all this would prove little.
    EXPECT_GT(calls, 5 * seeds) << nameOf(GetParam());
    EXPECT_GE(snapshots, betweenStates ? 0 : seeds);
}

INSTANTIATE_TEST_SUITE_P(EveryPosition, BusContract,
                         testing::Values(NodeField::immediate, NodeField::polled, NodeField::reporter,
                                         NodeField::listener, NodeField::onEvent, NodeField::onTime, NodeField::print),
                         [](const auto& position) { return nameOf(position.param); });

/// A Script's edits are its own: new nodes, values, children, routes.
TEST(BusContract, AScriptEditsAndEverybodySeesIt) {
    Scene scene;
    Diagnostics diagnostics;
    ScriptOptions options;
    options.print = [](std::string_view) {};
    runScripts(scene, std::move(options));
    ASSERT_TRUE(loadText(scene, kScene, diagnostics));
    scene.newFrame(0);
    Follower early, late, drained;
    early.name = "early", late.name = "late", drained.name = "drained";
    const Attachment first = scene.bus().attach(early);
    Attachment second = scene.bus().attach(drained, Delivery::polled);
    std::vector<Attachment> others;
    const NodeId script = scene.findName("S"), top = scene.findName("TOP");
    std::size_t maximum = 0;
    for (int i = 1; i <= 30; ++i) {
        ASSERT_TRUE(scene.sendEvent(script, scene.node(script).type().find("go"), std::int32_t{i}));
        EXPECT_EQ(scene.newFrame(i)->to, static_cast<std::uint64_t>(i) + 1) << "a frame is one set";
        maximum = std::max(maximum, scene.node(top).get(x3d::Group::children).size());
        if (i == 10) others.push_back(scene.bus().attach(late));
    }
    EXPECT_EQ(maximum, 1U);
    EXPECT_EQ(scene.node(scene.findName("SEEN")).get(x3d::Transform::translation), Vec3f(30, 0, 0));
    EXPECT_EQ(second.drain(), 31U);
    for (const Follower* one : {&early, &late, &drained}) EXPECT_EQ(one->replica.hash(), scene.hash()) << one->name;
    EXPECT_EQ(early.hashes, drained.hashes);
}

}  // namespace
}  // namespace rtsg::test
