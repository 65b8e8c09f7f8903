// The contract of a subscriber, as one suite that every kind of subscriber passes unchanged. A new one writes a Subject
// (most derive from BusSubject) and INSTANTIATE_TYPED_TEST_SUITE_P(Mine, SubscriberContract, MySubject).
//
// It rests on one notion: state() is what the subscriber has made of the scene. Equal scenes must give equal states,
// whatever the way there: attached early or late, frame by frame or merged, attached again, or after the scene started
// over. Threading: one thread. Property tests are seeded and print the seed.
#pragma once

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <rtsg/core/scene.h>
#include <rtsg/documents/loader.h>

#include "long_form.h"
#include "random_edits.h"
#include "test_paths.h"

namespace rtsg::test {

struct SubscriberState {
    std::string text;             // compared exactly
    std::vector<double> numbers;  // compared to within `tolerance` times their size (at least 1)
    double tolerance = 1e-4;
    /// The share of the numbers that may differ more: rays along an edge may go either way.
    double outliers = 0;
};

class Subject {
  public:
    virtual ~Subject() = default;
    /// Begins to follow the scene; again after detach().
    virtual void attach(Scene& scene, Delivery delivery) = 0;
    /// For Delivery::polled: takes what happened since, merged.
    virtual void poll() = 0;
    virtual void detach() = 0;
    /// The last state that it took: with Delivery::immediate the scene's newest, after detach() the state at that
    /// moment.
    virtual SubscriberState state() = 0;
    /// Why it could not go on; empty while it can.
    virtual std::string failure() const = 0;
    /// Whole states received since attach().
    virtual std::size_t snapshots() const = 0;
};

/// For whatever is a Subscriber: stands between it and the bus, and watches what the bus promises.
class BusSubject : public Subject, public Subscriber {
  public:
    void attach(Scene& scene, Delivery delivery) override {
        sets_ = snapshots_ = 0;
        attachment_ = scene.bus().attach(*this, delivery);
    }
    void poll() override { attachment_.poll(); }
    void detach() override { attachment_.detach(); }
    std::string failure() const override { return attachment_.failure(); }
    std::size_t snapshots() const override { return snapshots_; }

  protected:
    virtual Subscriber& subscriber() = 0;
    /// Derived destructors call this first: the bus must not call what is half destroyed.
    void release() { attachment_ = {}; }

  private:
    Result<> apply(const Scene& scene, const ChangeSet& changes) override {
        if (changes.isSnapshot())
            ++snapshots_;
        else
            EXPECT_EQ(changes.from, sequence_) << "a set that does not go on from the one before";
        EXPECT_EQ(changes.to, scene.sequence());
        EXPECT_TRUE(sets_++ > 0 || changes.isSnapshot()) << "the first set is no snapshot";
        sequence_ = changes.to;
        return subscriber().apply(scene, changes);
    }

    std::size_t sets_ = 0, snapshots_ = 0;
    std::uint64_t sequence_ = 0;
    Attachment attachment_;
};

/// A running scene (the examples' room) that is edited at random, in one group of it and everywhere in the room.
class EditedScene {
  public:
    explicit EditedScene(std::uint64_t seed) : random_(seed) {
        Diagnostics diagnostics;
        if (!loadFile(scene, RTSG_SOURCE_DIR "/examples/room.x3dv", diagnostics)) ADD_FAILURE() << "no room";
        const NodeId top = scene.createNode(x3d::Group::type);
        EXPECT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, top));
        edits_ = std::make_unique<RandomEdits>(scene, seed, top);
        scene.forEachNode([&](const Node& node) {
            if (node.id() != scene.root() && node.id() != top) edits_->adopt(node.id());
        });
    }
    void edit() {
        for (std::size_t i = random_() % 6; i > 0; --i) edits_->step();
    }
    void frame() {
        edit();
        scene.newFrame(time_ += 0.1);
    }
    bool chance(unsigned oneIn) { return random_() % oneIn == 0; }

    Scene scene;

  private:
    std::mt19937_64 random_;
    std::unique_ptr<RandomEdits> edits_;
    double time_ = 0;
};

inline void expectSame(Subject& a, Subject& b) {
    EXPECT_EQ(a.failure(), "");
    EXPECT_EQ(b.failure(), "");
    const SubscriberState x = a.state(), y = b.state();
    ASSERT_EQ(x.text, y.text);
    ASSERT_EQ(x.numbers.size(), y.numbers.size());
    std::size_t different = 0;
    std::string first;
    for (std::size_t i = 0; i < x.numbers.size(); ++i) {
        const double p = x.numbers[i], q = y.numbers[i];
        if (p == q || std::abs(p - q) <= x.tolerance * std::max(1.0, std::max(std::abs(p), std::abs(q)))) continue;
        if (std::isnan(p) && std::isnan(q)) continue;
        if (different++ == 0) first = std::to_string(i) + ": " + std::to_string(p) + " and " + std::to_string(q);
    }
    ASSERT_LE(static_cast<double>(different), x.outliers * static_cast<double>(x.numbers.size()))
        << different << " of " << x.numbers.size() << " numbers differ, the first is number " << first;
}

/// Calls `test(seed)` for 10 seeds, in the long form 400, until one fails.
template <class Test>
void forSeeds(const Test& test) {
    const std::uint64_t seeds = fewOrMany(10, 400);
    for (std::uint64_t seed = 1; seed <= seeds && !testing::Test::HasFatalFailure(); ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        test(seed);
    }
}

template <class S>
class SubscriberContract : public testing::Test {};
TYPED_TEST_SUITE_P(SubscriberContract);

/// Whether the scene is still empty or has run for long: it begins with a snapshot and needs no other.
TYPED_TEST_P(SubscriberContract, BeginsWithASnapshot) {
    Scene scene;
    TypeParam first;
    first.attach(scene, Delivery::immediate);
    Diagnostics diagnostics;
    ASSERT_TRUE(loadFile(scene, RTSG_SOURCE_DIR "/examples/room.x3dv", diagnostics));
    scene.newFrame(0);
    const std::size_t snapshots = first.snapshots();  // what leads from the empty scene is one, too
    for (int i = 1; i < 5; ++i) scene.newFrame(i);
    TypeParam second;
    second.attach(scene, Delivery::immediate);
    expectSame(first, second);
    // The rest of the suite would prove nothing if nothing could be told apart.
    const SubscriberState before = first.state();
    for (int i = 5; i < 7; ++i) scene.newFrame(i);
    const SubscriberState after = first.state();
    EXPECT_FALSE(before.text == after.text && before.numbers == after.numbers) << "a moving scene has equal states";
    EXPECT_EQ(first.snapshots(), snapshots);
    EXPECT_EQ(second.snapshots(), 1U);
}

TYPED_TEST_P(SubscriberContract, LateEqualsEarlyUnderRandomEdits) {
    forSeeds([](std::uint64_t seed) {
        EditedScene s(seed);
        TypeParam early;
        early.attach(s.scene, Delivery::immediate);
        for (int round = 0; round < 4; ++round) {
            for (int i = 0; i < 8; ++i) s.frame();
            s.edit();  // left pending
            TypeParam late;
            late.attach(s.scene, Delivery::immediate);
            ASSERT_NO_FATAL_FAILURE(expectSame(early, late)) << "round " << round;
            s.frame();
            ASSERT_NO_FATAL_FAILURE(expectSame(early, late)) << "round " << round << ", a frame later";
        }
    });
}

TYPED_TEST_P(SubscriberContract, MergedEqualsImmediate) {
    forSeeds([](std::uint64_t seed) {
        EditedScene s(seed + 100);
        TypeParam prompt, lazy;
        prompt.attach(s.scene, Delivery::immediate);
        lazy.attach(s.scene, Delivery::polled);
        int polls = 0;
        for (int i = 0; i < 40 || polls == 0; ++i) {
            s.frame();
            if (!s.chance(8)) continue;
            ++polls;
            lazy.poll();
            ASSERT_NO_FATAL_FAILURE(expectSame(prompt, lazy)) << "frame " << i;
        }
    });
}

TYPED_TEST_P(SubscriberContract, DetachesMidRunAndComesBack) {
    forSeeds([](std::uint64_t seed) {
        EditedScene s(seed + 200);
        TypeParam stays, goes;
        stays.attach(s.scene, Delivery::immediate);
        goes.attach(s.scene, Delivery::immediate);
        for (int i = 0; i < 10; ++i) s.frame();
        goes.detach();
        const SubscriberState left = goes.state();
        {
            TypeParam brief;
            brief.attach(s.scene, seed % 2 ? Delivery::immediate : Delivery::polled);
            s.frame();
        }  // destroyed while attached
        for (int i = 0; i < 10; ++i) s.frame();
        const SubscriberState later = goes.state();
        EXPECT_EQ(left.text, later.text);
        EXPECT_EQ(left.numbers, later.numbers);
        EXPECT_EQ(s.scene.bus().subscribers(), 1U);
        goes.attach(s.scene, Delivery::immediate);
        ASSERT_NO_FATAL_FAILURE(expectSame(stays, goes));
        for (int i = 0; i < 5; ++i) s.frame();
        ASSERT_NO_FATAL_FAILURE(expectSame(stays, goes));
    });
}

/// A replica that joins anew is emptied and gets another snapshot: what was before must be forgotten.
TYPED_TEST_P(SubscriberContract, StartsOverWhenTheSceneDoes) {
    forSeeds([](std::uint64_t seed) {
        EditedScene one(seed + 300), other(seed + 400);
        for (int i = 0; i < 10; ++i) one.frame(), other.frame();
        Scene replica;
        replica.setBehavioursEnabled(false);
        TypeParam subject;
        subject.attach(replica, Delivery::immediate);
        ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(one.scene.snapshot())));
        ASSERT_TRUE(replica.reset());
        ASSERT_TRUE(replica.apply(std::make_shared<const ChangeSet>(other.scene.snapshot())));
        TypeParam fresh;
        fresh.attach(replica, Delivery::immediate);
        ASSERT_NO_FATAL_FAILURE(expectSame(subject, fresh));
    });
}

/// Nothing is called, and nothing is touched, once the scene is gone.
TYPED_TEST_P(SubscriberContract, OutlivesTheScene) {
    TypeParam subject;
    {
        EditedScene s(500);
        subject.attach(s.scene, Delivery::immediate);
        for (int i = 0; i < 3; ++i) s.frame();
        subject.detach();
    }
    EXPECT_EQ(subject.failure(), "");
    (void)subject.state();
}

REGISTER_TYPED_TEST_SUITE_P(SubscriberContract, BeginsWithASnapshot, LateEqualsEarlyUnderRandomEdits,
                            MergedEqualsImmediate, DetachesMidRunAndComesBack, StartsOverWhenTheSceneDoes,
                            OutlivesTheScene);

}  // namespace rtsg::test
