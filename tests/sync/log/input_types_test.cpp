// Inputs that were recorded by a build with other built-in node types are run here: by the names of types and fields.
#include <algorithm>
#include <cstring>

#include <gtest/gtest.h>

#include <rtsg/core/hash_terms.h>
#include <rtsg/documents/loader.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/replay.h>

#include "support/log_support.h"
#include "support/temp_folder.h"
#include "sync/input_support.h"
#include "sync/other_types.h"

namespace rtsg {
namespace {

using namespace test;

LogOptions recording(Mode mode) {
    LogOptions options;
    options.mode.mode = mode;
    options.inputs = mode == Mode::state;
    options.keyframeBytes = 4000;
    options.keyframeFactor = .1;
    return options;
}

/// One type more and one fewer, all in another order, and so are their fields.
OtherTypes turnedRound() {
    OtherTypes types = otherTypes([](NodeType& type) {
        const auto hidden = std::ranges::find(type.fields, true, &FieldDef::hidden);
        std::reverse(type.fields.begin(), hidden);
        return type.name != "Arc2D";
    });
    auto torus = copyOf(*findBuiltinType("Sphere"));
    torus->name = "Torus";
    if (!torus->finish()) std::abort();
    types.push_back(std::move(torus));
    std::ranges::reverse(types);
    return types;
}

FieldDef wobble() {
    FieldDef field;
    field.name = "wobble";
    field.type = FieldType::SFVec3f;
    field.defaultValue = Vec3f(0);
    return field;
}

/// What a build with other types would have recorded of a scene.
struct OtherLog {
    OtherLog(const std::filesystem::path& file, Scene& recorded, TypeTable types, Mode mode)
        : scene(recorded), renumbered(recorded, types), log(*LogWriter::create(file, types, recording(mode))) {
        scene.setInputRecording(true);
    }
    /// `without`: terms that the writer's hash of the set's state lacks.
    void add(const ChangeSet& set, Hash128 without = {}) {
        const auto counted = [&](ChangeSet one) {
            one.hash = minus(one.hash, without);
            return one;
        };
        EXPECT_TRUE(log->write(counted(renumbered(set))));
        if (log->wantsSnapshot()) {
            EXPECT_TRUE(log->writeSnapshot(counted(renumbered(scene.snapshot()))));
        }
    }
    Scene& scene;
    Renumbered renumbered;
    std::unique_ptr<LogWriter> log;
};

/// Plays all of the log, and expects its last state to be the scene's.
void expectStatesOf(const std::filesystem::path& file, const Scene& origin) {
    auto replayer = Replayer::open(file);
    ASSERT_TRUE(replayer) << replayer.error().text;
    Replayer& log = **replayer;
    log.scene().registerBehaviour(x3d::Material::type, steady());
    Result<bool> more = true;
    while ((more = log.step()) && *more) EXPECT_EQ(log.lastSet().hash, log.scene().hash());
    ASSERT_TRUE(more) << more.error().text;
    EXPECT_FALSE(log.divergence()) << log.divergence()->format();
    EXPECT_GT(log.frames(), 1u);
    EXPECT_EQ(log.verified(), log.frames());
    EXPECT_EQ(log.scene().dump(), origin.dump());
}

/// The error or the divergence that playing the log ends with.
std::string problemOf(const std::filesystem::path& file) {
    auto replayer = Replayer::open(file);
    if (!replayer) return replayer.error().text;
    while (true) {
        const Result<bool> more = (*replayer)->step();
        if (!more) return more.error().text;
        if (!*more) return (*replayer)->divergence() ? (*replayer)->divergence()->format() : "";
    }
}

struct OneFile {
    const TempFolder folder;
    const std::filesystem::path file = folder.path() / "other.rlog";
};
/// Apart from the time of the next call, which only calls as time passes have.
bool sameCall(const BehaviourCall& a, const BehaviourCall& b) {
    return a.kind == b.kind && a.accepted == b.accepted && a.node == b.node && a.field == b.field &&
           a.effects == b.effects;
}

class InputTypesLaw : public OneFile, public testing::TestWithParam<std::uint64_t> {};
class InputTypes : public OneFile, public testing::Test {};

TEST_P(InputTypesLaw, InputsInOtherNumbersAreRunAsThoseInOnesOwn) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    const OtherTypes types = turnedRound();
    for (const Mode mode : {Mode::input, Mode::state}) {
        SCOPED_TRACE(mode == Mode::input ? "inputs alone" : "inputs beside changes");
        Scene origin;
        std::vector<std::shared_ptr<const FrameInput>> inputs;  // by state
        {
            OtherLog other(file, origin, types, mode);
            other.add(origin.snapshot());
            live(origin, GetParam(), 120, true, GetParam() % 2 == 0, [&](const ChangeSet& set) {
                inputs.resize(set.to + 1);
                inputs[set.to] = set.input;
                other.add(set);
            });
            ASSERT_TRUE(other.log->close());
        }
        if (mode == Mode::input) expectStatesOf(file, origin);
        auto replayer = Replayer::open(file);
        ASSERT_TRUE(replayer);
        Replayer& log = **replayer;
        log.scene().registerBehaviour(x3d::Material::type, steady());
        std::size_t withInput = 0;
        while (*log.step()) {
            const auto& read = log.lastSet().input;
            if (!read || log.lastSet().isSnapshot() || !read->complete) continue;
            ++withInput;
            const FrameInput& created = *inputs[log.lastSet().to];
            EXPECT_TRUE(std::ranges::equal(read->calls, created.calls, sameCall));
            EXPECT_EQ(read->events, created.events);
            EXPECT_EQ(read->edits.size(), created.edits.size());
        }
        EXPECT_EQ(log.verified(), log.frames());
        EXPECT_GT(withInput, 40u);
        for (const double time : {1.0, .3, 2.2, 0.0, .9}) {
            const auto there = log.seek(time);
            ASSERT_TRUE(there) << there.error().text;
            EXPECT_FALSE(log.divergence());
        }
    }
}
/// Bytes from anywhere in the numbers of anybody: errors and other hashes, never a crash.
TEST_P(InputTypesLaw, ForgedRecordsAreRefusedOrNoticed) {
    SCOPED_TRACE("seed " + std::to_string(GetParam()));
    const OtherTypes types = turnedRound();
    std::mt19937_64 random(GetParam() ^ 0xF09);
    for (const Mode mode : {Mode::input, Mode::state}) {
        Scene origin;
        {
            OtherLog other(file, origin, types, mode);
            other.add(origin.snapshot());
            live(origin, GetParam(), 60, true, true, [&](const ChangeSet& set) { other.add(set); });
            ASSERT_TRUE(other.log->close());
        }
        const std::string whole = readAll(file);
        for (int round = 0; round < 20; ++round) {
            std::string bytes = whole;
            for (std::size_t at = 0; at < bytes.size();) {
                const RecordHeader header = *parseRecordHeader(asBytes(bytes).subspan(at));
                if (header.length > 0 && header.kind != RecordKind::head && random() % 8 == 0) {
                    ByteBuffer record;
                    record.append(asBytes(bytes).subspan(at, header.size()));
                    record.data()[kRecordHeaderSize + random() % header.length] = static_cast<std::byte>(random());
                    sealRecord(record, header);
                    std::memcpy(bytes.data() + at, record.data(), record.size());
                }
                at += header.size();
            }
            writeAll(file, bytes);
            auto replayer = Replayer::open(file);
            ASSERT_TRUE(replayer) << replayer.error().text;
            (*replayer)->scene().registerBehaviour(x3d::Material::type, steady());
            for (Result<bool> more = true; !more || *more;) more = (*replayer)->step();
        }
    }
}

INSTANTIATE_TEST_SUITE_P(Seeds, InputTypesLaw, testing::Range<std::uint64_t>(1, 9));

constexpr const char* kMovingItem = R"(#X3D V4.0 utf8
PROFILE Immersive
PROTO Lamp [ inputOutput SFFloat power .5 ] { PointLight { intensity IS power } }
DEF CLOCK TimeSensor { cycleInterval 4 loop TRUE }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, 2 0 0 ] }
DEF THING Transform { children [ DEF SHAPE Shape { castShadow FALSE geometry Box { size 1 2 3 } } ] }
DEF LAMP Lamp { power .7 }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO THING.translation
)";

void loadMoving(Scene& scene) {
    Diagnostics diagnostics;
    ASSERT_TRUE(loadText(scene, kMovingItem, diagnostics));
}

/// A field that is new here is computed here, and is no part of the hash that was recorded.
TEST_F(InputTypes, WhatTheCascadeWritesToFieldsThatTheWriterLackedIsNotCounted) {
    const OtherTypes types = otherTypes([](NodeType& type) {
        if (type.name == "TimeSensor")
            std::erase_if(type.fields, [](const FieldDef& def) { return def.name == "elapsedTime"; });
        return true;
    });
    for (const Mode mode : {Mode::input, Mode::state}) {
        Scene origin;
        OtherLog other(file, origin, types, mode);
        loadMoving(origin);
        const NodeId clock = origin.findName("CLOCK");
        const auto elapsed = [&] { return termOf(origin, clock, x3d::TimeSensor::elapsedTime.index); };
        origin.newFrame(10);
        other.add(origin.snapshot(), elapsed());
        for (int frame = 1; frame <= 20; ++frame) {
            if (frame == 7) {
                ASSERT_TRUE(origin.setField(origin.findName("LAMP"), 0, Value(.25f)));
            }
            const auto set = origin.newFrame(10 + frame * .1);
            EXPECT_NE(elapsed(), Hash128{});
            other.add(*set, elapsed());
        }
        ASSERT_TRUE(other.log->close());
        if (mode == Mode::input) {
            expectStatesOf(file, origin);
        } else {
            EXPECT_EQ(problemOf(file), "");
        }
    }
}

TEST_F(InputTypes, AuthorsOfFieldsAreThoseOfTheFieldsHere) {
    const OtherTypes types = turnedRound();
    Scene origin;
    std::shared_ptr<const std::vector<Authored>> authors;
    {
        OtherLog other(file, origin, types, Mode::input);
        loadMoving(origin);
        origin.newFrame(0);
        other.add(origin.snapshot());
        const NodeId node = origin.findName("THING"), fresh = origin.createNode(x3d::Group::type);
        ASSERT_TRUE(origin.set(node, x3d::Transform::scale, Vec3f(2)));
        origin.attribute("Ann", node, x3d::Transform::scale.index);
        origin.attribute("Ben", fresh);
        const auto set = origin.newFrame(1);
        authors = set->authors;
        other.add(*set);
        ASSERT_TRUE(other.log->close());
    }
    ASSERT_TRUE(authors);
    ASSERT_EQ(authors->size(), 2u);
    auto replayer = Replayer::open(file);
    ASSERT_TRUE(replayer);
    while (*(*replayer)->step()) {
    }
    ASSERT_TRUE((*replayer)->lastSet().authors);
    EXPECT_EQ(*(*replayer)->lastSet().authors, *authors);
}

/// The hash that is told is the one that was compared.
TEST_F(InputTypes, ADivergenceTellsTheHashAsTheWriterCountsIt) {
    const OtherTypes types = otherTypes([](NodeType& type) {
        if (type.name == "TimeSensor")
            std::erase_if(type.fields, [](const FieldDef& def) { return def.name == "elapsedTime"; });
        return true;
    });
    Scene origin;
    OtherLog other(file, origin, types, Mode::input);
    loadMoving(origin);
    origin.newFrame(10);
    const auto counted = [&] {
        const NodeId clock = origin.findName("CLOCK");
        return minus(origin.hash(), termOf(origin, clock, x3d::TimeSensor::elapsedTime.index));
    };
    other.add(origin.snapshot(), minus(origin.hash(), counted()));
    const auto set = origin.newFrame(11);
    other.add(*set, Hash128{1, 0});
    ASSERT_TRUE(other.log->close());
    const std::string expected = "hash " + counted().hex() + ", recorded " + minus(origin.hash(), Hash128{1, 0}).hex();
    EXPECT_NE(problemOf(file).find(expected), std::string::npos) << problemOf(file);
}

TEST_F(InputTypes, DefaultsOfTheWriterCount) {
    const OtherTypes types = otherTypes([](NodeType& type) {
        if (type.name == "Shape")
            std::ranges::find(type.fields, "castShadow", &FieldDef::name)->defaultValue = Value(false);
        return true;
    });
    Scene origin;
    OtherLog other(file, origin, types, Mode::input);
    loadMoving(origin);
    std::vector<NodeId> shapes{origin.findName("SHAPE")};
    const auto terms = [&] {
        Hash128 sum;
        for (const NodeId shape : shapes) {
            const FieldIndex field = x3d::Shape::castShadow.index;
            const FieldDef& def = origin.node(shape).type().fields[field];
            const bool yes = true;
            if (origin.node(shape).get(x3d::Shape::castShadow))  // no default to the writer
                sum = minus(sum, hashOfValue(def.type, &yes, hashSeed(shape, fieldKey(def), HashTerm::field)));
            sum = sum + termOf(origin, shape, field);
        }
        return sum;
    };
    origin.newFrame(10);
    other.add(origin.snapshot(), terms());
    for (int frame = 1; frame <= 6; ++frame) {
        if (frame == 2) {
            ASSERT_TRUE(origin.set(shapes[0], x3d::Shape::castShadow, true));
        }
        if (frame == 3) {  // the other scene has this one's default by itself, and that one is written
            shapes.push_back(origin.createNode(x3d::Shape::type));
            ASSERT_TRUE(origin.set(shapes.back(), x3d::Shape::castShadow, false));
        }
        const auto set = origin.newFrame(10 + frame * .1);
        other.add(*set, terms());
    }
    ASSERT_TRUE(other.log->close());
    expectStatesOf(file, origin);
}

/// No node of the type is there yet, so nothing has told its name.
TEST_F(InputTypes, BehavioursWaitUntilTheirTypeIsDescribed) {
    const OtherTypes types = turnedRound();
    Scene origin;
    {
        OtherLog other(file, origin, types, Mode::input);
        origin.registerBehaviour(x3d::Material::type, steady());
        other.add(origin.snapshot());
        other.add(*origin.newFrame(1));
        const NodeId material = origin.createNode(x3d::Material::type);
        other.add(*origin.newFrame(2));
        ASSERT_TRUE(origin.sendEvent(material, x3d::Material::transparency.index, Value(.5f)));
        other.add(*origin.newFrame(3));
        ASSERT_TRUE(other.log->close());
    }
    expectStatesOf(file, origin);
    EXPECT_NE(problemOf(file).find("Material is not registered here"), std::string::npos) << problemOf(file);
}

TEST_F(InputTypes, TypesThatThisProgramLacksAreNamedOnceTheyAreNeeded) {
    const OtherTypes types = turnedRound();
    for (const bool used : {false, true})
        for (const bool fromTheStart : {false, true}) {
            Scene origin;
            OtherLog other(file, origin, types, Mode::input);
            std::shared_ptr<NodeType> torus = copyOf(*findBuiltinType("Sphere"));
            torus->name = "Torus";
            torus->kind = NodeType::Kind::user;
            ASSERT_TRUE(torus->finish());
            ASSERT_TRUE(origin.defineType(torus));
            if (used && fromTheStart) {
                ASSERT_TRUE(origin.createNode("Torus"));
            }
            origin.newFrame(0);
            other.add(origin.snapshot());
            other.add(*origin.newFrame(1));
            if (used && !fromTheStart) {
                ASSERT_TRUE(origin.createNode("Torus"));
            }
            other.add(*origin.newFrame(2));
            ASSERT_TRUE(other.log->close());
            if (!used) {
                EXPECT_EQ(problemOf(file), "");
                continue;
            }
            const std::string problem = problemOf(file);
            EXPECT_NE(problem.find("it needs Torus, a node type that this program lacks"), std::string::npos)
                << problem;
            EXPECT_NE(problem.find(fromTheStart ? "state 1:" : "state 3:"), std::string::npos) << problem;
        }
}

TEST_F(InputTypes, FieldsThatThisProgramLacksAreNamedOnceTheyAreNeeded) {
    const OtherTypes types = otherTypes([](NodeType& type) {
        if (type.name == "Transform") type.fields.insert(type.fields.begin(), wobble());
        return true;
    });
    enum class Need : std::uint8_t { none, set, routeFrom, routeTo, effect, hash };
    for (const Need need : {Need::none, Need::set, Need::routeFrom, Need::routeTo, Need::effect, Need::hash}) {
        SCOPED_TRACE(static_cast<int>(need));
        Scene origin;
        OtherLog other(file, origin, types, Mode::input);
        loadMoving(origin);
        const NodeId node = origin.findName("THING");
        origin.newFrame(0);
        other.add(origin.snapshot());
        ChangeSet last = other.renumbered(*origin.newFrame(1));
        auto input = std::make_shared<FrameInput>(*last.input);
        const FieldIndex field = other.renumbered.field("Transform", "wobble"),
                         known = other.renumbered.field("Transform", "translation");
        Change change;
        change.node = change.other = node;
        change.field = need == Need::routeTo ? known : field;
        change.index = need == Need::routeTo ? field : known;
        change.kind = need == Need::set ? ChangeKind::setField : ChangeKind::addRoute;
        if (need == Need::set) {
            change.value = Vec3f(1);
            change.index = 0;
            change.other = {};
        }
        if (need == Need::set || need == Need::routeFrom || need == Need::routeTo) input->edits.push_back(change);
        if (need == Need::effect) {
            BehaviourCall call{.kind = BehaviourCall::Kind::onTime, .node = node, .next = kNever, .effects = {}};
            call.effects.push_back({BehaviourEffect::Kind::store, node, field, Vec3f(1)});
            input->calls.push_back(call);
        }
        last.input = input;
        if (need == Need::hash) last.hash.low ^= 1;
        ASSERT_TRUE(other.log->write(last));
        ASSERT_TRUE(other.log->close());
        const std::string problem = problemOf(file);
        const std::string expected = need == Need::none   ? ""
                                     : need == Need::hash ? "a program with Transform.wobble, which this one lacks"
                                                          : "it needs Transform.wobble, and the Transform of this";
        EXPECT_NE(problem.find(expected), std::string::npos) << problem;
        EXPECT_EQ(problem.empty(), need == Need::none) << problem;
    }
}

}  // namespace
}  // namespace rtsg
