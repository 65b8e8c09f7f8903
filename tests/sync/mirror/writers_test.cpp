// Many writers: whose wish a change was, what each of them may take back, and what is locked for whom.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>

#include <fmt/format.h>

#include <rtsg/core/change_composer.h>
#include <rtsg/core/x3d.h>
#include <rtsg/sync/log.h>
#include <rtsg/sync/mirror_relay.h>
#include <rtsg/sync/replay.h>

#include "edits/request.h"
#include "edits/upstream.h"
#include "mirror_support.h"

namespace rtsg {
namespace {

using namespace std::chrono_literals;
using mirror::Verdict;
using testing::HasSubstr;
using RequestKind = MirrorRequest::Kind;
using T = x3d::Transform;

Change editOf(NodeId node, FieldIndex field, Value value) {
    Change change;
    change.node = node;
    change.field = field;
    change.value = std::move(value);
    return change;
}

Change ofNode(ChangeKind kind, NodeId node, Value value = {}) {
    Change change;
    change.kind = kind;
    change.node = node;
    change.value = std::move(value);
    return change;
}

Change child(ChangeKind kind, NodeId parent, NodeId node, std::uint32_t index) {
    Change change = ofNode(kind, parent);
    change.field = x3d::Group::children.index;
    change.other = node;
    change.index = index;
    return change;
}

Change routeFrom(NodeId from, FieldIndex a, NodeId to, FieldIndex b) {
    Change change = ofNode(ChangeKind::addRoute, from);
    change.field = a;
    change.other = to;
    change.index = b;
    return change;
}

/// A scene that several write to, without sockets: requests go through their records.
struct Desk {
    Scene scene;
    mirror::Writers writers;
    ChangeEncoder encoder;
    NodeId a, b, group;
    std::uint64_t requests = 0;
    std::shared_ptr<const std::vector<Authored>> authors;  // of the newest set

    struct Listening : Subscriber {
        std::shared_ptr<const std::vector<Authored>>* into = nullptr;
        Result<> apply(const Scene&, const ChangeSet& set) override {
            *into = set.authors;
            return {};
        }
    } listening;
    Attachment attachment;

    Desk() {
        a = scene.createNode(T::type);
        b = scene.createNode(T::type);
        group = scene.createNode(x3d::Group::type);
        EXPECT_TRUE(scene.setName(a, "A"));
        EXPECT_TRUE(scene.setName(b, "B"));
        EXPECT_TRUE(scene.setName(group, "G"));
        EXPECT_TRUE(scene.setField(scene.root(), x3d::RtsgScene::children.index, Array<NodeId>{a, b, group}));
        scene.newFrame(0);
        listening.into = &authors;
        attachment = scene.bus().attach(listening, Delivery::immediate);
    }
    Verdict ask(std::string author, MirrorRequest request, MirrorUpstream permission = MirrorUpstream::edits) {
        ByteBuffer record;
        mirror::writeRequest(encoder, std::move(request), 1, record);
        mirror::Submission submission{1, ++requests, permission, {}, false, std::move(author)};
        submission.record.assign(record.bytes().begin(), record.bytes().end());
        return carryOut(scene, submission, writers);
    }
    Verdict make(std::string author, std::vector<Change> changes) {
        MirrorRequest request;
        request.changes = std::move(changes);
        return ask(std::move(author), std::move(request));
    }
    Verdict move(std::string author, NodeId node, Vec3f to) {
        return make(std::move(author), {editOf(node, T::translation.index, to)});
    }
    Verdict undo(std::string author) {
        return ask(std::move(author), {.kind = RequestKind::undo, .changes = {}, .nodes = {}});
    }
    Verdict redo(std::string author) {
        return ask(std::move(author), {.kind = RequestKind::redo, .changes = {}, .nodes = {}});
    }
    Verdict lock(std::string author, std::vector<NodeId> nodes, std::chrono::milliseconds lease) {
        return ask(std::move(author),
                   {.kind = RequestKind::lock, .changes = {}, .nodes = std::move(nodes), .lease = lease});
    }
    Vec3f at(NodeId node) const { return scene.node(node).get(T::translation); }
    std::vector<std::string> children(NodeId node) const {
        std::vector<std::string> names;
        const Field<Array<NodeId>> children{scene.node(node).type().find("children")};
        for (const NodeId id : scene.node(node).get(children)) names.emplace_back(scene.name(id));
        return names;
    }
};

// ---- whose wish it was -------------------------------------------------------------------------------------------

TEST(Authors, AreThoseOfTheRequestsAndNobodyElses) {
    Desk desk;
    ASSERT_EQ(desk.move("ann", desk.a, {1, 0, 0}).refusal, "");
    ASSERT_TRUE(desk.authors);
    EXPECT_EQ(*desk.authors, (std::vector<Authored>{{desk.a, T::translation.index, String("ann")}}));
    EXPECT_TRUE(desk.scene.setField(desk.b, T::translation.index, Vec3f(1)));
    desk.scene.newFrame(1);
    EXPECT_EQ(desk.authors, nullptr) << "what the application does is its own";

    Change event = editOf(desk.a, T::translation.index, Vec3f(2, 0, 0));
    event.kind = ChangeKind::event;
    ASSERT_EQ(desk.make("bob", {event}).refusal, "");
    ASSERT_EQ(desk.move("ann", desk.b, {3, 0, 0}).refusal, "");
    ASSERT_TRUE(desk.authors);
    EXPECT_EQ(desk.authors->size(), 1u) << "an event waits for its frame, and so does its author";
    EXPECT_EQ(desk.authors->front().author, String("ann"));
    desk.scene.newFrame(2);
    ASSERT_TRUE(desk.authors);
    EXPECT_EQ(*desk.authors, (std::vector<Authored>{{desk.a, T::translation.index, String("bob")}}));
}

TEST(Authors, TheLastOneOfAFieldIsNamedWhereSetsAreMerged) {
    Desk desk;
    std::vector<std::shared_ptr<const ChangeSet>> sets;
    for (const auto& [who, node] : {std::pair{"ann", desk.a}, {"bob", desk.a}, {"ann", desk.b}}) {
        ASSERT_TRUE(desk.scene.setField(node, T::translation.index, Vec3f(static_cast<float>(sets.size() + 1))));
        desk.scene.attribute(who, node, T::translation.index);
        sets.push_back(desk.scene.seal());
    }
    const ChangeSet merged = compose(sets);
    ASSERT_TRUE(merged.authors);
    EXPECT_EQ(*merged.authors, (std::vector<Authored>{{desk.a, T::translation.index, String("bob")},
                                                      {desk.b, T::translation.index, String("ann")}}));
}

TEST(Authors, TravelInRecordsOfEveryCodingAndChangeNoHash) {
    std::mt19937 random(7);
    for (const Coding coding : {Coding::raw, Coding::compact, Coding::smallest}) {
        ChangeSet set;
        set.from = 1, set.to = 2;
        auto authors = std::make_shared<std::vector<Authored>>();
        for (std::uint32_t i = 0; i < 50; ++i)
            authors->push_back({NodeId{static_cast<std::uint32_t>(random() % 1000 + 1)},
                                i % 7 ? static_cast<FieldIndex>(i) : kNoField,
                                String("author " + std::to_string(random() % 5))});
        set.authors = authors;
        StreamMode mode;
        mode.coding = coding;
        ChangeEncoder encoder(mode);
        ByteBuffer record;
        encoder.encode(set, record);
        ChangeDecoder decoder(builtinTypes());
        ChangeSet again;
        ASSERT_TRUE(decoder.decode(record.bytes(), again));
        ASSERT_TRUE(again.authors);
        EXPECT_EQ(*again.authors, *authors);
        set.authors.reset();
        encoder.encode(set, record);
        ASSERT_TRUE(decoder.decode(record.bytes(), again));
        EXPECT_EQ(again.authors, nullptr);
    }
}

/// A server and its clients, frame by frame.
struct Session {
    Scene scene;
    NodeId a;
    std::unique_ptr<MirrorServer> server;
    double time = 0;

    explicit Session(StreamMode mode = {}) {
        a = scene.createNode(T::type);
        EXPECT_TRUE(scene.setName(a, "A"));
        EXPECT_TRUE(scene.setField(scene.root(), x3d::RtsgScene::children.index, Array<NodeId>{a}));
        scene.newFrame(0);
        MirrorServerOptions options;
        options.upstream = MirrorUpstream::edits;
        options.mode = mode;
        server = *MirrorServer::start(scene, test::kAnyPort, options);
    }
    void poll() {
        server->service();
        scene.newFrame(time += .1);
    }
    std::vector<MirrorVerdict> answersTo(MirrorClient& client, std::size_t count) {
        std::vector<MirrorVerdict> verdicts;
        EXPECT_TRUE(test::pollUntil(client, [&] {
            poll();
            for (MirrorVerdict& v : client.takeVerdicts()) verdicts.push_back(std::move(v));
            return verdicts.size() >= count;
        }));
        return verdicts;
    }
};

/// The author named for A.translation in the sets that come to a replica.
struct Names : Subscriber {
    std::vector<std::string> names;
    Result<> apply(const Scene&, const ChangeSet& set) override {
        if (set.authors)
            for (const Authored& one : *set.authors)
                if (one.field == T::translation.index) names.push_back(one.author.str());
        return {};
    }
};

TEST(Authors, ReachReplicasInBothModesAndTheirLogs) {
    const auto folder = std::filesystem::temp_directory_path() / ("rtsg_authors_" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    for (const Mode variant : {Mode::state, Mode::input}) {
        SCOPED_TRACE(static_cast<int>(variant));
        const auto file = folder / fmt::format("{}.rlog", static_cast<int>(variant));
        StreamMode mode;
        mode.mode = variant;
        Session session(mode);
        Scene replica;
        MirrorClientOptions options;
        options.name = "ann";
        options.inputs = variant == Mode::input;
        const auto client = *MirrorClient::connect(replica, session.server->endpoint(), options);
        ASSERT_TRUE(test::pollUntil(*client, [&] { return session.poll(), client->inStep(); }));
        Names heard;
        const Attachment attached = replica.bus().attach(heard, Delivery::immediate);
        LogOptions log;
        log.mode = mode;
        const auto writer = *LogWriter::create(file, builtinTypes(), log);
        Attachment logged = session.scene.bus().attach(*writer, Delivery::immediate);
        ASSERT_TRUE(client->submitEdit(session.a, T::translation.index, Vec3f(1)));
        ASSERT_TRUE(client->submitEvent(session.a, T::translation.index, Vec3f(2)));
        for (const MirrorVerdict& v : session.answersTo(*client, 2)) EXPECT_EQ(v.refusal, "");
        ASSERT_TRUE(test::pollUntilAt(*client, session.scene));
        EXPECT_EQ(heard.names, (std::vector<std::string>{"ann", "ann"}));
        logged = {};
        ASSERT_TRUE(writer->close());
        auto replayer = *Replayer::open(file);
        std::size_t named = 0;
        for (Result<bool> more = true; more && *more; more = replayer->step())
            if (const auto& authors = replayer->lastSet().authors) named += authors->size();
        EXPECT_EQ(named, 2u);
        EXPECT_FALSE(replayer->divergence());
    }
    std::filesystem::remove_all(folder);
}

TEST(Authors, OfThoseBehindARelayStandBehindItsName) {
    Session session;
    Scene middle, end;
    MirrorClientOptions up, leaf;
    up.name = "studio";
    leaf.name = "ann";
    MirrorServerOptions down;
    down.upstream = MirrorUpstream::edits;
    auto relay = *MirrorRelay::connect(middle, session.server->endpoint(), test::kAnyPort, up, down);
    ASSERT_TRUE(test::eventually([&] { return session.poll(), relay->poll() && relay->server(); }));
    const auto client = *MirrorClient::connect(end, relay->server()->endpoint(), leaf);
    Names heard;
    const Attachment attached = session.scene.bus().attach(heard, Delivery::immediate);
    ASSERT_TRUE(test::pollUntil(*client, [&] { return session.poll(), relay->poll() && client->inStep(); }));
    const auto answered = [&] {
        std::vector<MirrorVerdict> verdicts;
        EXPECT_TRUE(test::pollUntil(*client, [&] {
            session.poll();
            EXPECT_TRUE(relay->poll());
            verdicts = client->takeVerdicts();
            return !verdicts.empty();
        }));
        return verdicts.front();
    };
    ASSERT_TRUE(client->submitEdit(session.a, T::translation.index, Vec3f(1)));
    EXPECT_EQ(answered().refusal, "");
    EXPECT_EQ(heard.names, std::vector<std::string>{"studio/ann"});
    ASSERT_TRUE(client->undo());
    EXPECT_EQ(answered().refusal, "") << "undo passes through the relay under the same name";
    EXPECT_EQ(session.scene.node(session.a).get(T::translation), Vec3f(0));
    ASSERT_TRUE(client->redo());
    EXPECT_EQ(answered().refusal, "");
    EXPECT_EQ(session.scene.node(session.a).get(T::translation), Vec3f(1));
    ASSERT_TRUE(client->lock({session.a}, 5s));
    EXPECT_EQ(answered().refusal, "");
    ASSERT_TRUE(relay->client().statistics().equal);
}

// ---- taking back -------------------------------------------------------------------------------------------------

TEST(Undo, TakesBackOnesOwnRequestsFromTheLastOnAndDoesThemAgain) {
    Desk desk;
    desk.move("ann", desk.a, {1, 0, 0});
    desk.move("bob", desk.b, {9, 0, 0});
    desk.move("ann", desk.a, {2, 0, 0});
    EXPECT_EQ(desk.undo("ann").refusal, "");
    EXPECT_EQ(desk.at(desk.a), Vec3f(1, 0, 0));
    EXPECT_EQ(*desk.authors, (std::vector<Authored>{{desk.a, T::translation.index, String("ann")}}));
    EXPECT_EQ(desk.undo("ann").refusal, "");
    EXPECT_EQ(desk.at(desk.a), Vec3f(0));
    EXPECT_EQ(desk.undo("ann").refusal, "there is nothing to take back");
    EXPECT_EQ(desk.at(desk.b), Vec3f(9, 0, 0)) << "what others did stays";
    EXPECT_EQ(desk.redo("ann").refusal, "");
    EXPECT_EQ(desk.redo("ann").refusal, "");
    EXPECT_EQ(desk.at(desk.a), Vec3f(2, 0, 0));
    EXPECT_EQ(desk.redo("ann").refusal, "there is nothing to do again");
    desk.undo("ann");
    desk.move("ann", desk.a, {5, 0, 0});
    EXPECT_EQ(desk.redo("ann").refusal, "there is nothing to do again") << "something new ends what was taken back";
}

TEST(Undo, LeavesWhatSomebodyElseHasChangedSinceAndNamesIt) {
    Desk desk;
    desk.make("ann", {editOf(desk.a, T::translation.index, Vec3f(1)), editOf(desk.b, T::translation.index, Vec3f(1))});
    desk.move("bob", desk.a, {7, 0, 0});
    const Verdict verdict = desk.undo("ann");
    EXPECT_EQ(verdict.refusal, "");
    EXPECT_EQ(verdict.kept, "A.translation was changed since");
    EXPECT_EQ(desk.at(desk.a), Vec3f(7, 0, 0));
    EXPECT_EQ(desk.at(desk.b), Vec3f(0));
    desk.move("ann", desk.b, {3, 0, 0});
    desk.move("bob", desk.b, {4, 0, 0});
    EXPECT_EQ(desk.undo("ann").refusal, "B.translation was changed since") << "nothing of it could be taken back";
    EXPECT_EQ(desk.at(desk.b), Vec3f(4, 0, 0));
}

/// Who asks again reaches the request before; once the others' values are gone, one's own is taken back, too.
TEST(Undo, PassesOverWhatOthersHaveChangedUntilOnesOwnValueStandsAgain) {
    Desk desk;
    desk.move("ann", desk.b, {1, 0, 0});
    desk.move("ann", desk.a, {1, 0, 0});
    desk.move("bob", desk.a, {7, 0, 0});
    EXPECT_EQ(desk.undo("ann").refusal, "A.translation was changed since");
    EXPECT_EQ(desk.undo("ann").refusal, "");
    EXPECT_EQ(desk.at(desk.b), Vec3f(0)) << "asked again, it is the request before";
    EXPECT_EQ(desk.undo("ann").refusal, "others have changed since what is left to take back");
    EXPECT_EQ(desk.undo("bob").refusal, "");
    EXPECT_EQ(desk.at(desk.a), Vec3f(1, 0, 0)) << "ann's own value stands again";
    EXPECT_EQ(desk.undo("ann").refusal, "");
    EXPECT_EQ(desk.at(desk.a), Vec3f(0));
    EXPECT_EQ(desk.undo("ann").refusal, "there is nothing to take back");
    // Of those that are passed over only so many are kept.
    for (int i = 0; i < 100; ++i) {
        desk.move("ann", desk.a, {1, float(i), 0});
        desk.move("bob", desk.a, {2, float(i), 0});
        EXPECT_EQ(desk.undo("ann").refusal, "A.translation was changed since");
    }
    for (int i = 99; i > 99 - 16; --i) {
        ASSERT_EQ(desk.undo("bob").refusal, "");
        EXPECT_EQ(desk.undo("ann").refusal, "") << i;
    }
    ASSERT_EQ(desk.undo("bob").refusal, "");
    EXPECT_EQ(desk.undo("ann").refusal, "there is nothing to take back");
}

TEST(Undo, GivesNodesNamesRoutesAndPlacesBack) {
    Desk desk;
    const auto before = desk.scene.hash();
    const NodeId fresh{mirror::kFirstProvisional};
    std::vector<Change> changes = {ofNode(ChangeKind::createNode, fresh),
                                   editOf(fresh, T::translation.index, Vec3f(4)),
                                   child(ChangeKind::insertChild, desk.group, fresh, 0),
                                   child(ChangeKind::insertChild, desk.group, desk.b, 1),
                                   ofNode(ChangeKind::setName, fresh, String("NEW")),
                                   routeFrom(desk.a, T::translation.index, fresh, T::translation.index)};
    changes[0].index = T::type.value;
    ASSERT_EQ(desk.make("ann", changes).refusal, "");
    EXPECT_EQ(desk.children(desk.group), (std::vector<std::string>{"NEW", "B"}));
    const auto after = desk.scene.hash();
    EXPECT_EQ(desk.undo("ann").refusal, "");
    EXPECT_EQ(desk.scene.hash(), before) << "as if it had never been";
    EXPECT_EQ(desk.redo("ann").refusal, "");
    EXPECT_EQ(desk.children(desk.group), (std::vector<std::string>{"NEW", "B"}));
    const NodeId again = desk.scene.findName("NEW");
    ASSERT_TRUE(again);
    EXPECT_EQ(desk.at(again), Vec3f(4));
    EXPECT_EQ(desk.scene.routesTo(again).size(), 1u);
    EXPECT_NE(desk.scene.hash(), after) << "a node that comes back has another number";
    EXPECT_EQ(desk.undo("ann").refusal, "");
    EXPECT_EQ(desk.scene.hash(), before);
}

TEST(Undo, BringsBackWhatWasDestroyedWithAllThatHungOnIt) {
    Desk desk;
    ASSERT_TRUE(desk.scene.insertChild(desk.group, x3d::Group::children, desk.a));
    ASSERT_TRUE(desk.scene.insertChild(desk.group, x3d::Group::children, desk.b));
    ASSERT_TRUE(desk.scene.insertChild(desk.a, T::children, desk.b));
    ASSERT_TRUE(desk.scene.setField(desk.a, T::translation.index, Vec3f(1, 2, 3)));
    ASSERT_TRUE(desk.scene.addRoute(desk.b, T::scale.index, desk.a, T::scale.index));
    desk.scene.seal();
    // Both go, in one request, the one below first: it comes back into the one above.
    ASSERT_EQ(
        desk.make("ann", {ofNode(ChangeKind::destroyNode, desk.b), ofNode(ChangeKind::destroyNode, desk.a)}).refusal,
        "");
    EXPECT_FALSE(desk.scene.findName("A"));
    ASSERT_EQ(desk.undo("ann").refusal, "");
    const NodeId a = desk.scene.findName("A"), b = desk.scene.findName("B");
    ASSERT_TRUE(a && b);
    EXPECT_EQ(desk.at(a), Vec3f(1, 2, 3));
    EXPECT_EQ(desk.children(desk.group), (std::vector<std::string>{"A", "B"}));
    EXPECT_EQ(desk.children(desk.scene.root()), (std::vector<std::string>{"A", "B", "G"}));
    EXPECT_EQ(desk.scene.node(a).get(T::children), (Array<NodeId>{b}));
    EXPECT_EQ(desk.scene.routesFrom(b).size(), 1u);
    ASSERT_EQ(desk.redo("ann").refusal, "");
    EXPECT_FALSE(desk.scene.findName("A"));
    ASSERT_EQ(desk.undo("ann").refusal, "");
    EXPECT_TRUE(desk.scene.findName("A"));
}

TEST(Undo, OfANewNodeLeavesItWhereOthersHaveWorkedOnIt) {
    Desk desk;
    const NodeId fresh{mirror::kFirstProvisional};
    std::vector<Change> changes = {
        ofNode(ChangeKind::createNode, fresh), child(ChangeKind::insertChild, desk.group, fresh, 0),
        ofNode(ChangeKind::setName, fresh, String("NEW")), editOf(desk.a, T::translation.index, Vec3f(1))};
    changes[0].index = T::type.value;
    ASSERT_EQ(desk.make("ann", changes).refusal, "");
    desk.move("bob", desk.scene.findName("NEW"), {1, 1, 1});
    const Verdict verdict = desk.undo("ann");
    EXPECT_EQ(verdict.refusal, "");
    EXPECT_EQ(verdict.kept, "others have worked on NEW");
    EXPECT_EQ(desk.children(desk.group), std::vector<std::string>{"NEW"});
    EXPECT_EQ(desk.at(desk.a), Vec3f(0));
}

TEST(Undo, NamesTheListThatAChildCameFromAndLeavesWhatDoesNotFit) {
    Desk desk;
    ASSERT_EQ(desk.make("ann", {child(ChangeKind::insertChild, desk.group, desk.a, 0)}).refusal, "");
    ASSERT_EQ(desk.undo("ann").refusal, "");
    EXPECT_EQ(*desk.authors, (std::vector<Authored>{{desk.group, x3d::Group::children.index, String("ann")}}));
    // Taken out by one, the way back closed by another: a scene has no circles.
    ASSERT_TRUE(desk.scene.insertChild(desk.group, x3d::Group::children, desk.a));
    ASSERT_EQ(desk.make("ann", {child(ChangeKind::removeChild, desk.group, desk.a, 0)}).refusal, "");
    ASSERT_TRUE(desk.scene.insertChild(desk.a, T::children, desk.group));
    EXPECT_NE(desk.undo("ann").refusal, "");
    EXPECT_EQ(desk.redo("ann").refusal, "there is nothing to do again") << "what was not done is not done again";
    EXPECT_EQ(desk.children(desk.group), std::vector<std::string>{});
}

TEST(Undo, KnowsANodeThatCameBackInWhatWasDoneBefore) {
    Desk desk;
    ASSERT_EQ(desk.make("ann", {editOf(desk.group, x3d::Group::children.index, Array<NodeId>{desk.a, desk.b})}).refusal,
              "");
    ASSERT_EQ(desk.make("ann", {ofNode(ChangeKind::destroyNode, desk.b)}).refusal, "");
    ASSERT_EQ(desk.undo("ann").refusal, "");
    EXPECT_EQ(desk.children(desk.group), (std::vector<std::string>{"A", "B"}));
    const Verdict all = desk.undo("ann");
    EXPECT_EQ(all.refusal, "");
    EXPECT_EQ(all.kept, "") << "the list holds the node under its new number, as this author left it";
    EXPECT_EQ(desk.children(desk.group), std::vector<std::string>{});
}

TEST(Undo, NamesWhoBroughtANodeBackAtItAndAtItsPlaces) {
    Desk desk;
    ASSERT_TRUE(desk.scene.insertChild(desk.group, x3d::Group::children, desk.b));
    ASSERT_EQ(desk.make("ann", {ofNode(ChangeKind::destroyNode, desk.b)}).refusal, "");
    ASSERT_EQ(desk.undo("ann").refusal, "");
    ASSERT_TRUE(desk.authors);
    const auto byAnn = [](NodeId node, FieldIndex field) { return Authored{node, field, String("ann")}; };
    EXPECT_THAT(*desk.authors, testing::UnorderedElementsAre(byAnn(desk.scene.findName("B"), kNoField),
                                                             byAnn(desk.group, x3d::Group::children.index),
                                                             byAnn(desk.scene.root(), x3d::RtsgScene::children.index)));
}

TEST(Undo, TakesBackANameAndGivesItToItsHolder) {
    Desk desk;
    ASSERT_EQ(desk.make("ann", {ofNode(ChangeKind::setName, desk.a, String("B"))}).refusal, "");
    EXPECT_EQ(desk.scene.findName("B"), desk.a);
    ASSERT_EQ(desk.undo("ann").refusal, "");
    EXPECT_EQ(desk.scene.findName("A"), desk.a);
    EXPECT_EQ(desk.scene.findName("B"), desk.b);
}

TEST(Undo, AsksForThePermissionThatItTookAndLeavesEventsBe) {
    Desk desk;
    MirrorRequest request;
    request.changes = {editOf(desk.a, T::translation.index, Vec3f(1))};
    ASSERT_EQ(desk.ask("ann", request, MirrorUpstream::code).refusal, "");
    EXPECT_THAT(desk.undo("ann").refusal, HasSubstr("a permission that this peer lacks"));
    EXPECT_EQ(desk.ask("ann", {.kind = RequestKind::undo, .changes = {}, .nodes = {}}, MirrorUpstream::code).refusal,
              "");
    EXPECT_EQ(desk.ask("ann", {.kind = RequestKind::undo, .changes = {}, .nodes = {}}, MirrorUpstream::events).refusal,
              "this peer may send events, not edit");
    request.changes[0].kind = ChangeKind::event;
    ASSERT_EQ(desk.ask("cat", request).refusal, "");
    desk.scene.newFrame(1);
    EXPECT_EQ(desk.undo("cat").refusal, "there is nothing to take back");
}

TEST(Undo, ForgetsTheOldestAndRefusedRequests) {
    Desk desk;
    for (std::size_t i = 0; i <= mirror::EditHistory::kMaxSteps; ++i)
        desk.move("ann", desk.a, {static_cast<float>(i + 1), 0, 0});
    for (std::size_t i = 0; i < mirror::EditHistory::kMaxSteps; ++i) ASSERT_EQ(desk.undo("ann").refusal, "");
    EXPECT_EQ(desk.at(desk.a), Vec3f(1, 0, 0)) << "the first of 1,001 is forgotten";
    EXPECT_EQ(desk.undo("ann").refusal, "there is nothing to take back");
    EXPECT_NE(desk.make("bob", {child(ChangeKind::removeChild, desk.group, desk.a, 5)}).refusal, "");
    EXPECT_EQ(desk.undo("bob").refusal, "there is nothing to take back") << "what was refused was not done";
}

/// Random requests of one writer, taken back to the last one: the scene is as it was; and done again, as it became.
TEST(Undo, LawOfRandomRequests) {
    const std::uint32_t seed = std::random_device()();
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    for (int round = 0; round < 40; ++round) {
        Desk desk;
        const Hash128 before = desk.scene.hash();
        std::size_t steps = 0;
        for (int i = 0; i < 20; ++i) {
            std::vector<Change> changes;
            for (std::uint32_t k = 0; k <= random() % 3; ++k) {
                const NodeId node = random() % 2 ? desk.a : desk.b;
                switch (random() % 4) {
                    case 0:
                        changes.push_back(editOf(node, T::translation.index, Vec3f(static_cast<float>(random() % 3))));
                        break;
                    case 1:
                        changes.push_back(child(ChangeKind::insertChild, desk.group, node, 0));
                        break;
                    case 2:
                        changes.push_back(
                            ofNode(ChangeKind::setName, node, String("N" + std::to_string(random() % 3))));
                        break;
                    default:
                        changes.push_back(
                            routeFrom(node, T::scale.index, node == desk.a ? desk.b : desk.a, T::scale.index));
                }
            }
            const Verdict verdict = desk.make("ann", changes);
            ASSERT_EQ(verdict.refusal, "");
        }
        const Hash128 after = desk.scene.hash();
        while (desk.undo("ann").refusal != "there is nothing to take back") ASSERT_LT(++steps, 100u);
        EXPECT_EQ(desk.scene.hash(), before) << "round " << round;
        while (desk.redo("ann").refusal != "there is nothing to do again") ASSERT_LT(++steps, 200u);
        EXPECT_EQ(desk.scene.hash(), after) << "round " << round;
    }
}

// ---- locks -------------------------------------------------------------------------------------------------------

TEST(Locks, KeepANodeForOneUntilTheyEnd) {
    Desk desk;
    EXPECT_EQ(desk.lock("ann", {desk.a}, 60s).refusal, "");
    EXPECT_THAT(desk.move("bob", desk.a, {1, 0, 0}).refusal, HasSubstr("A is locked by ann for another"));
    EXPECT_THAT(desk.lock("bob", {desk.b, desk.a}, 1s).refusal, HasSubstr("locked by ann"));
    EXPECT_EQ(desk.move("ann", desk.b, {1, 0, 0}).refusal, "") << "of two nodes one was locked: none is";
    EXPECT_EQ(desk.move("bob", desk.b, {2, 0, 0}).refusal, "");
    EXPECT_EQ(desk.move("ann", desk.a, {2, 0, 0}).refusal, "");
    EXPECT_THAT(desk.make("bob", {ofNode(ChangeKind::destroyNode, desk.a)}).refusal, HasSubstr("locked by ann"));
    EXPECT_THAT(desk.make("bob", {routeFrom(desk.b, T::scale.index, desk.a, T::scale.index)}).refusal,
                HasSubstr("locked by ann"));
    Change event = editOf(desk.a, T::translation.index, Vec3f(1));
    event.kind = ChangeKind::event;
    EXPECT_THAT(desk.make("bob", {event}).refusal, HasSubstr("locked by ann"));
    EXPECT_EQ(desk.lock("bob", {desk.a}, 0s).refusal.substr(0, 18), "A is locked by ann") << "nobody opens another's";
    EXPECT_EQ(desk.lock("ann", {desk.a}, 0s).refusal, "");
    EXPECT_EQ(desk.move("bob", desk.a, {3, 0, 0}).refusal, "");

    EXPECT_EQ(desk.lock("ann", {desk.a}, 1ms).refusal, "");
    std::this_thread::sleep_for(2ms);
    EXPECT_EQ(desk.move("bob", desk.a, {4, 0, 0}).refusal, "") << "a lease ends by itself";
}

TEST(Locks, HoldAgainstUndoToo) {
    Desk desk;
    desk.move("bob", desk.a, {1, 0, 0});
    desk.lock("ann", {desk.a}, 60s);
    EXPECT_THAT(desk.undo("bob").refusal, HasSubstr("A is locked by ann"));
    EXPECT_EQ(desk.at(desk.a), Vec3f(1, 0, 0));
    desk.lock("ann", {desk.a}, 0s);
    EXPECT_EQ(desk.undo("bob").refusal, "") << "it waited for the lock to end";
    EXPECT_EQ(desk.at(desk.a), Vec3f(0));
}

TEST(Locks, CoverWhatBelongsToTheNodeHoweverItIsReached) {
    Desk desk;
    EXPECT_EQ(desk.make("bob", {routeFrom(desk.b, T::scale.index, desk.a, T::scale.index)}).refusal, "");
    EXPECT_EQ(desk.lock("ann", {desk.a}, 60s).refusal, "");
    EXPECT_THAT(desk.make("bob", {ofNode(ChangeKind::setName, desk.b, String("A"))}).refusal,
                HasSubstr("A is locked by ann"))
        << "a name is taken from its holder";
    Change created = ofNode(ChangeKind::createNode, NodeId{mirror::kFirstProvisional});
    created.index = desk.scene.node(desk.b).typeIndex().value;
    EXPECT_THAT(desk.make("bob", {created, ofNode(ChangeKind::setName, created.node, String("A"))}).refusal,
                HasSubstr("A is locked by ann"));
    EXPECT_THAT(desk.make("bob", {ofNode(ChangeKind::destroyNode, desk.b)}).refusal, HasSubstr("A is locked by ann"))
        << "its route would go with the other end";
    EXPECT_THAT(desk.undo("bob").refusal, HasSubstr("A is locked by ann")) << "a route belongs to both its ends";
    EXPECT_EQ(desk.scene.routesTo(desk.a).size(), 1u);
    EXPECT_EQ(desk.scene.name(desk.a), "A");
    EXPECT_EQ(desk.make("bob", {ofNode(ChangeKind::setName, desk.b, String("C"))}).refusal, "");
}

TEST(Locks, OfAGroupKeepItsChildrenInIt) {
    Desk desk;
    EXPECT_EQ(desk.make("bob", {child(ChangeKind::insertChild, desk.group, desk.b, 0)}).refusal, "");
    desk.lock("ann", {desk.group}, 60s);
    EXPECT_THAT(desk.make("bob", {ofNode(ChangeKind::destroyNode, desk.b)}).refusal, HasSubstr("G is locked by ann"));
    EXPECT_EQ(desk.children(desk.group), std::vector<std::string>{"B"});
    EXPECT_EQ(desk.move("bob", desk.b, {1, 0, 0}).refusal, "") << "what is below a locked node is free";
    desk.lock("ann", {desk.group}, 0s);
    EXPECT_EQ(desk.make("bob", {ofNode(ChangeKind::destroyNode, desk.b)}).refusal, "");
    desk.lock("ann", {desk.group}, 60s);
    EXPECT_THAT(desk.undo("bob").refusal, HasSubstr("G is locked by ann")) << "nor does undo put one back into it";
    EXPECT_EQ(desk.children(desk.group), std::vector<std::string>{});
}

TEST(Locks, ThatMakeNoSenseAreRefused) {
    Desk desk;
    EXPECT_EQ(desk.lock("ann", {NodeId{4711}}, 1s).refusal, "no node 4711");
    EXPECT_THAT(desk.lock("ann", {desk.a}, 61s).refusal, HasSubstr("a lease longer than may be given"));
    EXPECT_THAT(desk.lock("ann", std::vector<NodeId>(1025, desk.a), 1s).refusal, HasSubstr("too many nodes"));
    EXPECT_EQ(desk.ask("ann", {.kind = RequestKind::lock, .changes = {}, .nodes = {desk.a}, .lease = 1s},
                       MirrorUpstream::events)
                  .refusal,
              "this peer may send events, not edit");
}

TEST(Requests, OfBrokenBytesAreRefused) {
    Desk desk;
    ByteBuffer record;
    mirror::writeRequest(desk.encoder,
                         {.kind = RequestKind::lock, .changes = {}, .nodes = {desk.a, desk.b}, .lease = 5s}, 1, record);
    const std::span<const std::byte> whole = record.bytes();
    std::size_t refused = 0;
    for (std::size_t cut = kRecordHeaderSize; cut < whole.size(); ++cut) {
        ByteBuffer part;
        part.append(whole.subspan(0, cut));
        RecordHeader header;
        header.kind = RecordKind::request;
        header.from = header.to = 1;
        sealRecord(part, header);
        refused += !mirror::readRequest(part.bytes(), false);
    }
    EXPECT_EQ(refused, whole.size() - kRecordHeaderSize);
    for (unsigned kind = 0; kind < 256; ++kind) {
        ByteBuffer odd;
        odd.room(kRecordHeaderSize);
        odd.advance(kRecordHeaderSize);
        odd.put(static_cast<std::uint8_t>(kind));
        RecordHeader header;
        header.kind = RecordKind::request;
        header.from = header.to = 1;
        sealRecord(odd, header);
        EXPECT_EQ(mirror::readRequest(odd.bytes(), false).has_value(), kind == 1 || kind == 2) << kind;
    }
}

TEST(Keys, NameTheirHolders) {
    const auto file = std::filesystem::temp_directory_path() / ("rtsg_named_" + std::to_string(::getpid()) + ".key");
    std::filesystem::remove(file);
    ASSERT_TRUE(MirrorKeys::generate(file));
    const auto keys = *MirrorKeys::load(file);
    const std::string key = keys.clientPublic.front();
    std::ofstream(file, std::ios::app) << "client-public " << key << " edits  Ann of Dresden \n";
    const auto named = MirrorKeys::load(file);
    ASSERT_TRUE(named) << named.error().text;
    EXPECT_EQ(named->names.at(key), "Ann of Dresden");
    EXPECT_EQ(named->upstream.at(key), MirrorUpstream::edits);
    std::ofstream(file, std::ios::app) << "client-public " << key << " edits " << std::string(201, 'x') << "\n";
    EXPECT_THAT(MirrorKeys::load(file).error().text, HasSubstr("a name of 201 bytes"));
    std::filesystem::remove(file);
}

}  // namespace
}  // namespace rtsg
