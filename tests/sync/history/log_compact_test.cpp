// Compacting logs: what is kept, what is merged.
#include <rtsg/sync/log_compact.h>

#include <algorithm>
#include <set>

#include <rtsg/core/x3d.h>

#include "support/log_support.h"

namespace rtsg {
namespace {

using namespace test;
using Compaction = LogFolder;

TEST_F(Compaction, MergedFramesLeadToTheSameStates) {
    for (std::uint64_t seed = 1; seed <= 6; ++seed)
        for (const std::uint64_t every : {1, 2, 7, 1000}) {
            SCOPED_TRACE(testing::Message() << "seed " << seed << ", every " << every);
            const Recorded recorded = record(file(), 50, seed, seed % 2 ? LogOptions{} : denseKeyframes());
            CompactOptions options;
            options.every = every;
            const auto report = compactLog(file(), file("b.rlog"), options);
            ASSERT_TRUE(report) << report.error().text;
            const Replayed replayed = replay(file("b.rlog"), recorded);
            ASSERT_FALSE(replayed.states.empty());
            EXPECT_EQ(replayed.states.back(), recorded.last);
            EXPECT_EQ(replayed.damage, 0u);
            EXPECT_EQ(report->statesWritten, 2 + (report->statesRead - 2 + every - 1) / every);
            EXPECT_EQ(report->bytesWritten, std::filesystem::file_size(file("b.rlog")));
            const auto difference = diffLogs(file(), file("b.rlog"));
            ASSERT_TRUE(difference);
            EXPECT_FALSE(*difference) << (*difference)->format();
        }
}

TEST_F(Compaction, APartInTimeBeginsAndEndsWithTheStatesAskedFor) {
    const Recorded recorded = record(file(), 60, 9);
    CompactOptions options;
    options.from = 2.05;
    options.to = 4.0;
    ASSERT_TRUE(compactLog(file(), file("b.rlog"), options));
    const Replayed replayed = replay(file("b.rlog"), recorded);
    ASSERT_FALSE(replayed.states.empty());
    EXPECT_NEAR(recorded.times.at(replayed.states.front()), 2.0, 1e-9);
    EXPECT_NEAR(recorded.times.at(replayed.states.back()), 4.0, 1e-9);
    EXPECT_EQ(replayed.states.size(), 21u);
    EXPECT_LT(std::filesystem::file_size(file("b.rlog")), std::filesystem::file_size(file()));
}

/// 1.9 s, and 2.9 s whose times begin at 0 again.
TEST_F(Compaction, APartOfALaterSessionIsFoundByTheTimeSinceTheLogsStart) {
    record(file("first.rlog"), 20, 8);
    const Recorded second = record(file("second.rlog"), 30, 9);
    writeAll(file(), readAll(file("first.rlog")) + readAll(file("second.rlog")));
    CompactOptions options;
    options.from = 1.9 + .55;
    options.to = 1.9 + 1.55;
    const auto report = compactLog(file(), file("b.rlog"), options);
    ASSERT_TRUE(report) << report.error().text;
    const Replayed replayed = replay(file("b.rlog"), second);
    ASSERT_EQ(replayed.states.size(), 11u);
    EXPECT_NEAR(second.times.at(replayed.states.front()), .5, 1e-9);
    EXPECT_NEAR(second.times.at(replayed.states.back()), 1.5, 1e-9);
    EXPECT_EQ(report->lacks, "");
}

TEST_F(Compaction, AnIntervalThinsFramesOut) {
    const Recorded recorded = record(file(), 60, 10);
    CompactOptions options;
    options.interval = .5;
    ASSERT_TRUE(compactLog(file(), file("b.rlog"), options));
    const Replayed replayed = replay(file("b.rlog"), recorded);
    // The first and the last, and of those between each that is half a second later than the one before.
    std::vector<std::uint64_t> kept{replayed.states.front()};
    for (const auto& [state, time] : recorded.times)
        if (state == recorded.last || (state > kept.back() && time - recorded.times.at(kept.back()) >= .5))
            kept.push_back(state);
    EXPECT_EQ(replayed.states, kept);
}

TEST_F(Compaction, DamageIsLeftOutAndSaid) {
    const Recorded recorded = record(file(), 40, 11, denseKeyframes());
    std::string bytes = readAll(file());
    const auto records = recordsOf(file());
    bytes[records[records.size() / 2].first + 70] ^= 1;
    writeAll(file(), bytes);
    const auto report = compactLog(file(), file("b.rlog"));
    ASSERT_TRUE(report) << report.error().text;
    EXPECT_EQ(report->damaged, 1u);
    const Replayed before = replay(file(), recorded), after = replay(file("b.rlog"), recorded);
    EXPECT_EQ(after.damage, 0u);
    EXPECT_EQ(after.states, before.states);
}

TEST_F(Compaction, ProgressGrowsAndEndsItWithoutAFile) {
    record(file(), 400, 13);
    CompactOptions options;
    std::uint64_t last = 0, calls = 0;
    options.progress = [&](std::uint64_t done, std::uint64_t total) {
        EXPECT_GE(done, last);
        EXPECT_LE(done, total);
        EXPECT_EQ(total, std::filesystem::file_size(file()));
        last = done;
        return ++calls < 1'000'000;
    };
    ASSERT_TRUE(compactLog(file(), file("b.rlog"), options));
    EXPECT_GT(calls, 0U);
    options.progress = [](std::uint64_t, std::uint64_t) { return false; };
    EXPECT_FALSE(compactLog(file(), file("c.rlog"), options));
    std::size_t files = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder)) ++files;
    EXPECT_EQ(files, 2U) << "the two logs, and nothing half";
}

TEST_F(Compaction, FilesThatCannotBeAreErrorsAndNothingIsLost) {
    const Recorded recorded = record(file(), 5, 12);
    EXPECT_FALSE(compactLog(file(), file()));
    EXPECT_FALSE(compactLog(file("none.rlog"), file("b.rlog")));
    EXPECT_FALSE(compactLog(file(), folder / "gone" / "b.rlog"));
    EXPECT_FALSE(std::filesystem::exists(file("b.rlog")));
    EXPECT_FALSE(std::filesystem::exists(file("b.rlog.new")));
    EXPECT_EQ(replay(file(), recorded).states.size(), recorded.dumps.size());
}

TEST_F(Compaction, WhatTheOldLogLacksIsNamed) {
    record(file(), 60, 11, denseKeyframes());
    const auto records = recordsOf(file());
    const std::string bytes = readAll(file());
    const auto frame = std::ranges::find_if(records.begin() + 20, records.end(),
                                            [](const auto& r) { return r.second.kind == RecordKind::frame; });
    writeAll(file("gap.rlog"), bytes.substr(0, frame->first) + bytes.substr(frame->first + frame->second.size()));
    const auto whole = compactLog(file(), file("b.rlog"));
    ASSERT_TRUE(whole);
    EXPECT_EQ(whole->lacks, "");
    EXPECT_EQ(whole->gaps, 0u);
    const auto partial = compactLog(file("gap.rlog"), file("c.rlog"));
    ASSERT_TRUE(partial) << partial.error().text;
    EXPECT_EQ(partial->gaps, 1u);
    EXPECT_TRUE(partial->lacks.contains("are missing")) << partial->lacks;
    // Before the part that is kept it does not matter.
    CompactOptions later;
    later.from = 5;
    const auto part = compactLog(file("gap.rlog"), file("d.rlog"), later);
    ASSERT_TRUE(part) << part.error().text;
    EXPECT_EQ(part->lacks, "");
}

/// A log whose beginning is gone, and one whose first bytes are: said, whatever is still to be had.
TEST_F(Compaction, ABeginningThatIsMissingIsNamed) {
    record(file(), 60, 11, denseKeyframes());
    const auto records = recordsOf(file());
    const std::string bytes = readAll(file());
    const auto frame = std::ranges::find_if(records.begin() + 4, records.end(),
                                            [](const auto& r) { return r.second.kind == RecordKind::frame; });
    writeAll(file("late.rlog"), bytes.substr(frame->first));
    const auto late = compactLog(file("late.rlog"), file("b.rlog"));
    ASSERT_TRUE(late) << late.error().text;
    EXPECT_EQ(late->gaps, 1u);
    EXPECT_TRUE(late->lacks.contains("are missing")) << late->lacks;
    writeAll(file("head.rlog"), "X" + bytes.substr(1));
    const auto head = compactLog(file("head.rlog"), file("c.rlog"));
    ASSERT_TRUE(head) << head.error().text;
    EXPECT_EQ(head->damaged, 1u);
    EXPECT_TRUE(head->lacks.contains("damaged")) << head->lacks;
    // A part behind it lacks nothing.
    CompactOptions part;
    part.from = 5;
    EXPECT_EQ(compactLog(file("late.rlog"), file("d.rlog"), part)->lacks, "");
}

/// The end of the log does not matter if it is behind the kept part; nobody knows what follows a log that was not
/// closed.
TEST_F(Compaction, AnEndThatIsOpenIsNamed) {
    record(file(), 60, 11);
    const auto records = recordsOf(file());
    writeAll(file("open.rlog"), readAll(file()).substr(0, records.back().first));
    const auto whole = compactLog(file("open.rlog"), file("b.rlog"));
    ASSERT_TRUE(whole) << whole.error().text;
    EXPECT_TRUE(whole->lacks.contains("was not closed")) << whole->lacks;
    CompactOptions before;
    before.to = 3;
    const auto part = compactLog(file("open.rlog"), file("c.rlog"), before);
    ASSERT_TRUE(part) << part.error().text;
    EXPECT_EQ(part->lacks, "");
}

/// The values in a log's scene, by the node's number and the field's name.
std::map<std::pair<std::uint32_t, std::string>, Value> valuesOf(const Scene& scene) {
    std::map<std::pair<std::uint32_t, std::string>, Value> values;
    scene.forEachNode([&](const Node& node) {
        for (FieldIndex field = 0; field < node.type().fieldCount(); ++field)
            if (node.type().slot(field).offset != FieldDef::kNoOffset)
                values.emplace(std::pair(node.id().value, node.type().fields[field].name), node.value(field));
    });
    return values;
}

/// Fields that are left out are as they were in the first state, or when their node came; all others are the log's.
TEST_F(Compaction, FieldsThatAreLeftOutStayAsTheyWereWhenTheirNodeCame) {
    std::size_t logs = 0;
    for (std::uint64_t seed = 21; seed <= 30; ++seed) {
        SCOPED_TRACE(testing::Message() << "seed " << seed);
        record(file(), 40, seed, denseKeyframes());
        CompactOptions options;
        (seed % 2 ? options.only : options.without) = {"*.translation", "*.rotation"};
        const auto report = compactLog(file(), file("b.rlog"), options);
        if (!report) {  // no node that has a translation got a name
            EXPECT_EQ(report.error().code, DiagnosticCode("no-such-field")) << report.error().text;
            continue;
        }
        ++logs;
        auto whole = Replayer::open(file()), cut = Replayer::open(file("b.rlog"));
        ASSERT_TRUE(whole && cut);
        std::map<std::pair<std::uint32_t, std::string>, Value> first;
        std::size_t differing = 0;
        while (true) {
            const auto more = (*whole)->step();
            ASSERT_TRUE(more);
            ASSERT_EQ((*cut)->step().value_or(!*more), *more);
            if (!*more) break;
            EXPECT_EQ((*cut)->scene().sequence(), (*whole)->scene().sequence());
            EXPECT_EQ((*cut)->time(), (*whole)->time());
            const auto expected = valuesOf((*whole)->scene()), own = valuesOf((*cut)->scene());
            std::erase_if(first, [&](const auto& one) { return !expected.contains(one.first); });
            first.insert(expected.begin(), expected.end());
            ASSERT_EQ(own.size(), expected.size());
            for (const auto& [key, value] : expected) {
                // Names come and go, and with them what is chosen.
                if (key.second == "translation" || key.second == "rotation") continue;
                const bool stays = seed % 2 == 0 || sf(value.type()) == FieldType::SFNode;
                EXPECT_EQ(own.at(key), stays ? value : first.at(key)) << key.first << '.' << key.second;
                differing += value != first.at(key);
            }
            EXPECT_EQ((*cut)->scene().routeCount(), (*whole)->scene().routeCount());
        }
        EXPECT_EQ((*cut)->verified(), (*cut)->frames());
        EXPECT_GT(differing, 100u);
    }
    EXPECT_GE(logs, 4u);
}

TEST_F(Compaction, OneFieldOfManyMoves) {
    {
        Scene scene;
        auto log = LogWriter::create(file(), builtinTypes());
        ASSERT_TRUE(log);
        NodeId nodes[2];
        for (NodeId& node : nodes) {
            node = scene.createNode(x3d::Transform::type);
            ASSERT_TRUE(scene.setName(node, node == nodes[0] ? "A" : "B"));
            ASSERT_TRUE(scene.insertChild(scene.root(), x3d::RtsgScene::children, node));
        }
        const Attachment attachment = scene.bus().attach(**log);
        for (int k = 0; k < 10; ++k) {
            for (const NodeId node : nodes) {
                ASSERT_TRUE(scene.set(node, x3d::Transform::translation, Vec3f(static_cast<float>(k), 0, 0)));
                scene.attribute(node == nodes[0] ? "anna" : "bert", node, x3d::Transform::translation.index);
            }
            if (k == 5) {
                ASSERT_TRUE(scene.setName(nodes[0], "C"));
            }
            scene.newFrame(k);
        }
        ASSERT_TRUE((*log)->close());
    }
    CompactOptions options;
    options.without = {"A.translation"};
    ASSERT_TRUE(compactLog(file(), file("b.rlog"), options));
    auto cut = Replayer::open(file("b.rlog"));
    ASSERT_TRUE(cut);
    std::set<std::string> authors;
    while (*(*cut)->step()) {
        const auto x = [&](const char* name) {
            const NodeId node = (*cut)->scene().findName(name);
            return node ? (*cut)->scene().node(node).get(x3d::Transform::translation).x : -1;
        };
        if ((*cut)->lastSet().authors)
            for (const Authored& one : *(*cut)->lastSet().authors) authors.insert(one.author.str());
        const float t = static_cast<float>((*cut)->time());
        EXPECT_EQ(x("B"), t);
        EXPECT_EQ(x("A"), t < 5 ? 0 : -1);
        EXPECT_EQ(x("C"), t < 5 ? -1 : t);  // under another name it is another field
    }
    EXPECT_TRUE(authors.contains("bert"));
    EXPECT_TRUE(authors.contains("anna"));  // of what C does
    for (const auto& [patterns, text] : {std::pair(std::vector<std::string>{"D.*"}, "no state has a field D.*"),
                                         {{"A.children"}, "always stay"},
                                         {{"A"}, "expected NODE.field"}}) {
        options.without = patterns;
        const auto refused = compactLog(file(), file("c.rlog"), options);
        ASSERT_FALSE(refused);
        EXPECT_NE(refused.error().text.find(text), std::string::npos) << refused.error().text;
        EXPECT_FALSE(std::filesystem::exists(file("c.rlog")));
    }
}

}  // namespace
}  // namespace rtsg
