// The change bus when somebody edits, seals, runs frames, attaches or detaches from within a delivery or a frame: every
// subscriber still sees every set, whole and in order.
#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <random>
#include <thread>

#include <gtest/gtest.h>

#include <rtsg/core/behaviour.h>
#include <rtsg/core/change_composer.h>
#include <rtsg/core/scene.h>
#include <rtsg/core/x3d.h>

namespace rtsg {
namespace {

std::string codeOf(const Diagnostics& diagnostics) {
    return diagnostics.all().empty() ? "none" : std::string(diagnostics.all().back().code.text());
}

/// Follows with a replica, notes which sets came, and does what it is told to from within.
struct Witness : Subscriber {
    Scene replica;
    std::vector<std::pair<std::uint64_t, std::uint64_t>> sets;  // from, to
    std::function<void(const ChangeSet&)> within;
    Witness() { replica.setBehavioursEnabled(false); }
    Result<> apply(const Scene& scene, const ChangeSet& changes) override {
        EXPECT_LE(changes.to, scene.sequence());
        sets.emplace_back(changes.from, changes.to);
        if (changes.isSnapshot() && replica.sequence() != 0)
            if (auto ok = replica.reset(); !ok) return ok;
        if (auto ok = replica.apply(std::make_shared<const ChangeSet>(changes)); !ok) return ok;
        if (within) within(changes);
        return {};
    }
};

/// One follows before the one that meddles, one after it.
class FromWithin : public testing::Test {
  protected:
    FromWithin() {
        box_ = scene_.createNode(x3d::Transform::type);
        EXPECT_TRUE(scene_.insertChild(scene_.root(), x3d::RtsgScene::children, box_));
        scene_.newFrame(0);
        for (auto* one : {&early_, &meddler_, &late_}) attachments_.push_back(scene_.bus().attach(*one));
    }
    void move(float x) { EXPECT_TRUE(scene_.set(box_, x3d::Transform::translation, Vec3f(x, 0, 0))); }
    /// All have seen 0->1 as a snapshot, then each state up to this one.
    void expectAllSawAll(std::uint64_t last) {
        EXPECT_EQ(scene_.sequence(), last);
        std::vector<std::pair<std::uint64_t, std::uint64_t>> all{{0, 1}};
        for (std::uint64_t to = 2; to <= last; ++to) all.emplace_back(to - 1, to);
        for (const Witness* one : {&early_, &meddler_, &late_}) {
            EXPECT_EQ(one->sets, all);
            EXPECT_EQ(one->replica.hash(), scene_.hash());
        }
    }

    Scene scene_;
    NodeId box_;
    Witness early_, meddler_, late_;
    std::vector<Attachment> attachments_;
};

TEST_F(FromWithin, ASubscriberEditsAndSeals) {
    meddler_.within = [&](const ChangeSet& set) {
        if (set.to >= 4) return;
        move(static_cast<float>(set.to));
        const auto sealed = scene_.seal();
        ASSERT_TRUE(sealed);
        EXPECT_EQ(sealed->from, set.to);
    };
    move(100);
    scene_.newFrame(1);
    expectAllSawAll(4);
}

TEST_F(FromWithin, ASubscriberRunsFrames) {
    meddler_.within = [&](const ChangeSet& set) {
        if (set.to == 2) scene_.newFrame(2), scene_.newFrame(3);
    };
    scene_.newFrame(1);
    expectAllSawAll(4);
}

TEST_F(FromWithin, EditsThatNobodySealsComeWithTheNextSet) {
    meddler_.within = [&](const ChangeSet& set) {
        if (set.to == 2) move(7);
    };
    scene_.newFrame(1);
    EXPECT_EQ(late_.sets.back().second, 2U);
    scene_.newFrame(2);
    expectAllSawAll(3);
}

TEST_F(FromWithin, ANodeThatGoesIsThereForNobodyAndGoneForAll) {
    meddler_.within = [&](const ChangeSet& set) {
        if (set.to != 2) return;
        ASSERT_TRUE(scene_.destroyNode(box_));
        scene_.seal();
    };
    move(3);  // the others are told of a node that is gone by then
    scene_.newFrame(1);
    expectAllSawAll(3);
    EXPECT_FALSE(late_.replica.find(box_));
}

TEST_F(FromWithin, SubscribersAttachAndDetach) {
    Witness joined;
    Attachment joining;
    meddler_.within = [&](const ChangeSet& set) {
        if (set.to != 2) return;
        move(5);
        joining = scene_.bus().attach(joined);
        attachments_[0].detach();
    };
    scene_.newFrame(1);
    scene_.newFrame(2);
    EXPECT_EQ(joined.sets, (std::vector<std::pair<std::uint64_t, std::uint64_t>>{{0, 3}, {3, 4}}));
    EXPECT_EQ(joined.replica.hash(), scene_.hash());
    EXPECT_EQ(late_.replica.hash(), scene_.hash());
    EXPECT_EQ(early_.sets.back().second, 2U);
    EXPECT_EQ(scene_.bus().subscribers(), 3U);
}

TEST_F(FromWithin, AResetEndsTheDeliveryAndAllStartOver) {
    Scene other;
    ASSERT_TRUE(other.setName(other.createNode(x3d::Group::type), "OTHER"));
    other.newFrame(0);
    meddler_.within = [&](const ChangeSet& set) {
        if (set.to != 2) return;
        move(9);
        scene_.seal();  // never comes: it is about a state that is gone
        ASSERT_TRUE(scene_.reset());
        ASSERT_TRUE(scene_.apply(std::make_shared<const ChangeSet>(other.snapshot())));
    };
    scene_.newFrame(1);
    EXPECT_EQ(late_.sets, (std::vector<std::pair<std::uint64_t, std::uint64_t>>{{0, 1}, {0, 1}}));
    for (const Witness* one : {&early_, &meddler_, &late_}) EXPECT_EQ(one->replica.hash(), other.hash());
}

TEST_F(FromWithin, AnAnswerToEverySetComesToAnEnd) {
    float x = 0;
    meddler_.within = [&](const ChangeSet& set) {
        if (set.isSnapshot()) return;
        move(++x);
        scene_.seal();
    };
    scene_.newFrame(1);
    EXPECT_GT(x, 100.0f);
    EXPECT_EQ(codeOf(scene_.diagnostics()), "from-within");
    meddler_.within = nullptr;
    scene_.newFrame(2);  // what was edited last was not lost
    EXPECT_EQ(late_.replica.node(box_).get(x3d::Transform::translation), Vec3f(x, 0, 0));
    EXPECT_EQ(late_.replica.hash(), scene_.hash());
}

/// Beyond the limit nothing is sealed, so there is no state to tell until the next frame.
TEST_F(FromWithin, WhoAttachesWhereNoStateCanBeToldGetsTheNextOne) {
    Witness joined;
    Attachment joining;
    float x = 0;
    meddler_.within = [&](const ChangeSet& set) {
        if (set.isSnapshot()) return;
        move(++x);
        if (!scene_.seal() && !joining.attached()) joining = scene_.bus().attach(joined);
    };
    scene_.newFrame(1);
    EXPECT_TRUE(joining.attached());
    EXPECT_TRUE(joined.sets.empty());
    EXPECT_TRUE(scene_.hasUnsealedEdits());
    EXPECT_EQ(scene_.snapshot().to, 0U) << "the answer to its own seal leaves edits again";
    meddler_.within = nullptr;
    const ChangeSet whole = scene_.snapshot();
    EXPECT_EQ(whole.to, scene_.sequence());
    scene_.newFrame(2);
    ASSERT_FALSE(joined.sets.empty());
    EXPECT_EQ(joined.sets.front().first, 0U);
    EXPECT_GT(joined.sets.front().second, 100U);
    EXPECT_EQ(joined.replica.hash(), scene_.hash());
    EXPECT_EQ(late_.replica.hash(), scene_.hash());
}

// ---- inside a frame ------------------------------------------------------------------------------------------------

class InsideAFrame : public FromWithin {
  protected:
    /// Calls `does` once, from the event listener of one frame.
    void fromListener(const std::function<void()>& does) {
        bool done = false;
        scene_.setEventListener([&](double, const Node&, FieldIndex, const Value&) {
            if (!std::exchange(done, true)) does();
        });
        ASSERT_TRUE(scene_.sendEvent(box_, x3d::Transform::scale.index, Vec3f(2)));
        scene_.newFrame(1);
        scene_.setEventListener({});
        EXPECT_TRUE(done);
    }
};

TEST_F(InsideAFrame, EditsBelongToItAndItIsNeverSealedInHalves) {
    fromListener([&] {
        move(4);
        EXPECT_FALSE(scene_.seal());
    });
    expectAllSawAll(2);
    EXPECT_EQ(late_.replica.node(box_).get(x3d::Transform::translation), Vec3f(4, 0, 0));
}

TEST_F(InsideAFrame, AnotherFrameIsRefused) {
    fromListener([&] { EXPECT_TRUE(scene_.newFrame(5)->changes.empty()); });
    EXPECT_EQ(codeOf(scene_.diagnostics()), "from-within");
    EXPECT_EQ(scene_.now(), 1);
    expectAllSawAll(2);
}

TEST_F(InsideAFrame, TheStateCannotBeReplaced) {
    fromListener([&] {
        const Result<> applied = scene_.apply(std::make_shared<const ChangeSet>(scene_.snapshot()));
        ASSERT_FALSE(applied);
        EXPECT_EQ(applied.error().code.text(), "from-within");
        EXPECT_FALSE(scene_.reset());
    });
    expectAllSawAll(2);
}

TEST_F(InsideAFrame, WhoAttachesGetsTheFrameWhole) {
    Witness joined, polling, gone;
    Attachment a, b;
    fromListener([&] {
        a = scene_.bus().attach(joined);
        b = scene_.bus().attach(polling, Delivery::polled);
        (void)scene_.bus().attach(gone);  // and detaches at once
        move(6);
    });
    EXPECT_EQ(joined.sets, (std::vector<std::pair<std::uint64_t, std::uint64_t>>{{0, 2}}));
    EXPECT_EQ(joined.replica.hash(), scene_.hash());
    EXPECT_TRUE(b.poll());
    EXPECT_EQ(polling.replica.hash(), scene_.hash());
    EXPECT_TRUE(gone.sets.empty());
    expectAllSawAll(2);
}

/// A behaviour of the application that edits the scene itself, beside what it emits.
TEST_F(InsideAFrame, ABehaviourEdits) {
    static Scene* scene = nullptr;
    static NodeId target;
    scene = &scene_;
    target = box_;
    const Behaviour meddles{.onEvent = [](Cascade&, const Node&, FieldIndex, EventValue) {
        const NodeId created = scene->createNode(x3d::Group::type);
        EXPECT_TRUE(scene->insertChild(target, x3d::Transform::children, created));
        EXPECT_FALSE(scene->seal());
    }};
    scene_.registerBehaviour(x3d::Switch::type, meddles);
    const NodeId chooser = scene_.createNode(x3d::Switch::type);
    ASSERT_TRUE(scene_.sendEvent(chooser, x3d::Switch::whichChoice.index, std::int32_t{0}));
    scene_.newFrame(1);
    expectAllSawAll(2);
    EXPECT_EQ(late_.replica.node(box_).get(x3d::Transform::children).size(), 1U);
}

// ---- failures and backlogs -----------------------------------------------------------------------------------------

struct Failing : Subscriber {
    Result<> apply(const Scene&, const ChangeSet&) override { return fail("enough"); }
    std::string subscriberName() const override { return "failing"; }
};

TEST(BusReports, APolledSubscriberThatFailsIsReportedAsAnImmediateOneIs) {
    Scene scene;
    std::vector<std::string> reports;
    scene.bus().setReporter([&](const Diagnostic& d) { reports.push_back(d.format()); });
    Failing failing;
    Attachment attachment = scene.bus().attach(failing, Delivery::polled);
    EXPECT_TRUE(attachment.poll());
    EXPECT_EQ(reports, std::vector<std::string>{"failing: error: detached: enough [subscriber-failed]"});
    EXPECT_FALSE(attachment.attached());
    EXPECT_TRUE(scene.diagnostics().all().empty());
}

/// A subscriber that chose nothing reads no errors.
TEST(BusReports, StandardErrorHearsUnlessAReporterIsChosenOrNone) {
    struct Shown : Failing {
        std::string subscriberName() const override { return "sh\x1b[31m\xc2\x9bown"; }
    };
    const auto said = [](auto&& prepare) {
        testing::internal::CaptureStderr();
        Scene scene;
        prepare(scene);
        Shown failing;
        const Attachment attachment = scene.bus().attach(failing);
        EXPECT_FALSE(attachment.attached());
        return testing::internal::GetCapturedStderr();
    };
    EXPECT_EQ(said([](Scene&) {}), "sh?[31m??own: error: detached: enough [subscriber-failed]\n");
    EXPECT_EQ(said([](Scene& scene) { scene.bus().setReporter({}); }), "");
    EXPECT_EQ(said([](Scene& scene) { scene.bus().setReporter([](const Diagnostic&) {}); }), "");
}

TEST(BusReports, WhatNobodyListensToIsFoundWithTheScene) {
    for (const Delivery delivery : {Delivery::immediate, Delivery::polled}) {
        Scene scene;
        Failing failing;
        Attachment attachment = scene.bus().attach(failing, delivery);
        attachment.poll();
        ASSERT_EQ(scene.diagnostics().all().size(), 1U);
        EXPECT_EQ(scene.diagnostics().all()[0].format(), "failing: error: detached: enough [subscriber-failed]");
        EXPECT_EQ(scene.diagnostics().errors(), 1U);  // once
    }
}

TEST(BusReports, WhoFailsWhileDrainingGetsNoMore) {
    struct Second : Subscriber {
        int calls = 0;
        Result<> apply(const Scene&, const ChangeSet&) override { return ++calls < 2 ? Result<>() : fail("enough"); }
    };
    Scene scene;
    Second second;
    Attachment attachment = scene.bus().attach(second, Delivery::polled);
    for (int i = 1; i <= 5; ++i) {
        scene.createNode(x3d::Transform::type);
        scene.newFrame(i);
    }
    attachment.drain();
    EXPECT_EQ(second.calls, 2);
    EXPECT_FALSE(attachment.attached());
    EXPECT_EQ(attachment.drain(), 0U);
}

TEST(BusBacklog, DrainingALongOneGivesWhatIsMergedFirstThenEachFrame) {
    Scene scene;
    Witness slow;
    Attachment attachment = scene.bus().attach(slow, Delivery::polled);
    const NodeId box = scene.createNode(x3d::Transform::type);
    for (int i = 1; i <= 1000; ++i) {
        ASSERT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(static_cast<float>(i))));
        scene.newFrame(i);
    }
    const std::size_t count = attachment.drain();
    EXPECT_EQ(count, slow.sets.size());
    EXPECT_GT(count, 100U);
    EXPECT_LT(count, 500U);
    EXPECT_EQ(slow.sets.front().first, 0U);
    for (std::size_t i = 1; i < count; ++i) {
        EXPECT_EQ(slow.sets[i].first, slow.sets[i - 1].second);
        EXPECT_EQ(slow.sets[i].second, slow.sets[i].first + 1);
    }
    EXPECT_EQ(slow.replica.hash(), scene.hash());
    EXPECT_EQ(attachment.drain(), 0U);
}

/// Where the scene's thread would not merge yet, somebody else has: sooner or later only the last 256 are as they were.
TEST(BusBacklog, IsMergedBesideTheScenesThread) {
    for (std::size_t count = 0, patience = 1; patience < 20'000 && count != 2 * 257; patience *= 2) {
        Scene scene;
        Witness slow;
        Attachment attachment = scene.bus().attach(slow, Delivery::polled);
        count = 0;
        for (int round = 0; round < 2; ++round) {  // and again, after it was taken
            for (int i = 1; i < 380; ++i) scene.newFrame(380 * round + i);
            std::this_thread::sleep_for(std::chrono::milliseconds(patience));
            count += attachment.drain();
        }
        EXPECT_EQ(slow.sets.back().second, scene.sequence());
        EXPECT_EQ(slow.replica.hash(), scene.hash());
        for (std::size_t i = 1; i < slow.sets.size(); ++i) EXPECT_EQ(slow.sets[i].first, slow.sets[i - 1].second);
        if (2 * patience >= 20'000) {
            EXPECT_EQ(count, 2 * 257U);
        }
    }
}

/// The backlog is merged, taken, cleared and started again at the same time, on three threads.
TEST(BusBacklog, IsWholeHoweverItIsTakenWhileItIsMerged) {
    const unsigned seed = std::random_device{}();
    RecordProperty("seed", static_cast<int>(seed));
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    Scene scene;
    std::vector<NodeId> boxes;  // enough of them that to merge a set takes a while
    for (int i = 0; i < 300; ++i) boxes.push_back(scene.createNode(x3d::Transform::type));
    struct Witnessed : Subscriber {  // on a thread that has no scene
        std::vector<std::pair<std::uint64_t, std::uint64_t>> sets;
        ChangeComposer composer;
        Result<> apply(const Scene&, const ChangeSet& set) override {
            sets.emplace_back(set.from, set.to);
            composer.add(set);
            return {};
        }
        Hash128 hash() {
            Scene replica;
            EXPECT_TRUE(replica.apply(std::make_shared<const ChangeSet>(composer.take())));
            return replica.hash();
        }
    };
    struct Follower {
        Witnessed witness;
        std::mutex mutex;  // of the attachment
        Attachment attachment;
        std::mt19937 random;
    } one, two;
    std::atomic<bool> ending = false;
    const auto follow = [&ending](Follower& f) {
        for (bool last = false; !last;) {
            last = ending;
            {
                const std::scoped_lock lock(f.mutex);
                f.random() % 2 ? f.attachment.poll() : f.attachment.drain() != 0;
            }
            std::this_thread::sleep_for(std::chrono::microseconds(f.random() % 4000));
        }
    };
    one.random.seed(seed + 1), two.random.seed(seed + 2);
    one.attachment = scene.bus().attach(one.witness, Delivery::polled);
    std::thread first([&] { follow(one); }), second([&] { follow(two); });
    for (int i = 1; i <= 6'000; ++i) {
        for (const NodeId box : boxes)
            ASSERT_TRUE(scene.set(box, x3d::Transform::translation, Vec3f(static_cast<float>(i))));
        scene.newFrame(i);
        if (i % 1000 != 0) continue;
        const std::scoped_lock lock(two.mutex);  // comes, and goes with all that waits for it
        two.attachment.detach();
        two.witness.sets.clear();
        (void)two.witness.composer.take();
        if (random() % 4) two.attachment = scene.bus().attach(two.witness, Delivery::polled);
    }
    ending = true;
    first.join(), second.join();
    EXPECT_TRUE(one.witness.hash() == scene.hash());
    if (two.attachment.attached()) {
        EXPECT_TRUE(two.witness.hash() == scene.hash());
    }
    for (const Follower* f : {&one, &two})
        for (std::size_t i = 1; i < f->witness.sets.size(); ++i)
            ASSERT_EQ(f->witness.sets[i].first, f->witness.sets[i - 1].second) << i;
}

/// A scene that starts over makes void what waits and what is being merged.
TEST(BusBacklog, IsForgottenWhenTheSceneStartsOver) {
    Scene scene;
    Witness slow;
    Attachment attachment = scene.bus().attach(slow, Delivery::polled);
    for (int round = 0; round < 30; ++round) {
        for (int i = 1; i < 350; ++i) {
            scene.createNode(x3d::Transform::type);
            scene.newFrame(i);
        }
        ASSERT_TRUE(scene.reset());
        const NodeId only = scene.createNode(x3d::Shape::type);
        ASSERT_TRUE(scene.setName(only, "ONLY"));
        scene.newFrame(round);
        if (round % 3 == 0) continue;
        ASSERT_TRUE(attachment.poll());
        EXPECT_EQ(slow.replica.hash(), scene.hash()) << round;
    }
}

/// Nodes that come and go leave nothing behind in what waits.
TEST(BusBacklog, IsBoundedByTheSceneNotByWhatHasPassed) {
    Scene scene;
    struct Count : Subscriber {
        std::size_t changes = 0, capacity = 0;
        Result<> apply(const Scene&, const ChangeSet& set) override {
            changes = set.changes.size();
            capacity = set.changes.capacity();
            return {};
        }
    } count;
    Attachment attachment = scene.bus().attach(count, Delivery::polled);
    for (int i = 0; i < 5000; ++i) {
        const NodeId passing = scene.createNode(x3d::Transform::type);
        ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, passing));
        scene.newFrame(i);
        ASSERT_TRUE(scene.destroyNode(passing));
    }
    scene.newFrame(5000);
    ASSERT_TRUE(attachment.poll());
    EXPECT_LE(count.changes, 8U);
}

}  // namespace
}  // namespace rtsg
