// A client of another program, that knows only what PROTOCOL.md and the stream tell it: it joins with 0 for its types,
// sends edits in the server's numbers, and describes types that the stream has not.
#include <algorithm>
#include <mutex>

#include <gtest/gtest.h>

#include <rtsg/core/x3d.h>
#include <rtsg/sync/change_codec.h>

#include "edits/upstream.h"
#include "mirror_support.h"
#include "sockets/message.h"

namespace rtsg {
namespace {

using mirror::Message;

class ForeignClient {
  public:
    explicit ForeignClient(const std::string& endpoint)
        : context_(zmq_ctx_new()), socket_(zmq_socket(context_, ZMQ_DEALER)) {
        const int none = 0;
        zmq_setsockopt(socket_, ZMQ_LINGER, &none, sizeof(none));
        zmq_connect(socket_, endpoint.c_str());
        mirror::Hello hello;
        hello.session = 7;
        hello.window = 1 << 20;
        hello.name = "foreign";
        hello.wishes.client = 99;
        hello.write(message_);
        zmq_send(socket_, message_.data(), message_.size(), 0);
    }
    ~ForeignClient() {
        zmq_close(socket_);
        zmq_ctx_term(context_);
    }
    void submit(std::uint64_t request, const ByteBuffer& record) {
        const std::uint64_t numbers[] = {7, request, record.size(), 0};
        mirror::write(message_, Message::submit, numbers);
        zmq_send(socket_, message_.data(), message_.size(), ZMQ_SNDMORE);
        zmq_send(socket_, record.data(), record.size(), 0);
    }
    /// Reads what has come; acknowledges, so that there is always credit.
    bool poll() {
        std::vector<std::string> parts;
        int more = 1;
        while (more) {
            zmq_msg_t part;
            zmq_msg_init(&part);
            const bool any = zmq_msg_recv(&part, socket_, ZMQ_DONTWAIT) >= 0;
            if (any) parts.emplace_back(static_cast<const char*>(zmq_msg_data(&part)), zmq_msg_size(&part));
            more = any && zmq_msg_more(&part);
            zmq_msg_close(&part);
            if (!any) return false;
        }
        wire::Reader in(std::as_bytes(std::span(parts[0])));
        const auto type = mirror::readPrologue(in);
        const auto session = in.number<std::uint64_t>();
        if (type == Message::data) {
            received_ += parts[1].size();
            const std::uint64_t numbers[] = {session, 0, received_};
            mirror::write(message_, Message::ack, numbers);
            zmq_send(socket_, message_.data(), message_.size(), 0);
        } else if (type == Message::verdict) {
            verdict.emplace();
            EXPECT_TRUE(verdict->read(in));
        }
        return true;
    }
    std::optional<mirror::Verdict> verdict;

  private:
    void *context_, *socket_;
    ByteBuffer message_;
    std::uint64_t received_ = 0;
};

struct ForeignOrigin {
    Scene scene;
    NodeId box;
    std::unique_ptr<MirrorServer> server;

    ForeignOrigin() {
        box = scene.createNode(x3d::Transform::type);
        EXPECT_TRUE(scene.setField(scene.root(), x3d::RtsgScene::children.index, Array<NodeId>{box}));
        scene.newFrame(0);
        MirrorServerOptions options;
        options.upstream = MirrorUpstream::edits;
        server = *MirrorServer::start(scene, "tcp://127.0.0.1:*", options);
    }
    mirror::Verdict verdictOf(ForeignClient& client, std::uint64_t request, const ByteBuffer& record) {
        client.verdict.reset();
        client.submit(request, record);
        EXPECT_TRUE(test::eventually([&] {
            server->service();
            while (client.poll()) continue;
            return client.verdict.has_value();
        }));
        return client.verdict.value_or(mirror::Verdict{});
    }
};

ByteBuffer foreignRecord(std::vector<Change> changes, TypeTable types) {
    ChangeSet set;
    set.from = set.to = 1;  // any state
    set.changes = std::move(changes);
    ByteBuffer record;
    ChangeEncoder({}, types).encode(set, record);
    return record;
}

Change foreignEdit(NodeId node, FieldIndex field, Value value) {
    Change change;
    change.node = node;
    change.field = field;
    change.value = std::move(value);
    return change;
}

TEST(ForeignUpstream, EditsInTheServersNumbersAreTaken) {
    ForeignOrigin origin;
    ForeignClient client(origin.server->endpoint());
    const auto record = foreignRecord({foreignEdit(origin.box, x3d::Transform::translation.index, Vec3f(1, 2, 3))}, {});
    EXPECT_EQ(origin.verdictOf(client, 1, record).refusal, "");
    EXPECT_EQ(origin.scene.node(origin.box).get(x3d::Transform::translation), Vec3f(1, 2, 3));
}

TEST(ForeignUpstream, TypesThatItDescribesAreFoundByName) {
    // Two types, none of them where ours is, with fields that are elsewhere.
    const auto type = [](const char* name, std::vector<std::pair<const char*, FieldType>> fields) {
        auto built = std::make_unique<NodeType>();
        built->name = name;
        for (const auto& [field, kind] : fields) {
            FieldDef& def = built->fields.emplace_back();
            def.name = field;
            def.type = kind;
        }
        EXPECT_TRUE(built->finish());
        return built;
    };
    std::vector<std::unique_ptr<NodeType>> own;
    own.push_back(type("Group", {{"children", FieldType::MFNode}}));
    own.push_back(type("Sphere", {{"solid", FieldType::SFBool}, {"radius", FieldType::SFFloat}}));
    const NodeId created{mirror::kFirstProvisional};
    Change create;
    create.kind = ChangeKind::createNode;
    create.node = created;
    create.index = 1;
    ForeignOrigin origin;
    ForeignClient client(origin.server->endpoint());
    const auto verdict = origin.verdictOf(client, 1, foreignRecord({create, foreignEdit(created, 1, 2.5f)}, own));
    ASSERT_EQ(verdict.refusal, "");
    ASSERT_EQ(verdict.created.size(), 1u);
    const Node& sphere = origin.scene.node(NodeId{verdict.created[0].second});
    EXPECT_EQ(sphere.type().name, "Sphere");
    EXPECT_EQ(sphere.get(x3d::Sphere::radius), 2.5f);

    std::vector<std::unique_ptr<NodeType>> unheardOf;
    unheardOf.push_back(type("Hovercraft", {{"eels", FieldType::SFInt32}}));
    create.index = 0;
    EXPECT_NE(
        origin.verdictOf(client, 2, foreignRecord({create}, unheardOf)).refusal.find("node types come from files only"),
        std::string::npos);
}

/// A server that seems to be of another version: the head that it begins its stream with has another dictionary hash.
class OtherVersion {
  public:
    explicit OtherVersion(const std::string& server)
        : middle_(server, [this](bool toClient, auto& parts) {
              wire::Reader in(std::as_bytes(std::span(parts[0])));
              const auto type = mirror::readPrologue(in);
              if (!toClient && type == Message::hello) {
                  mirror::Hello hello;
                  EXPECT_TRUE(hello.read(in));
                  const std::scoped_lock lock(mutex_);
                  hashes_.push_back(hello.dictionaryHash);
              }
              if (toClient && type == Message::welcome) parts[1] = test::withOtherTypes(parts[1]);
              return true;
          }) {}
    const std::string& endpoint() const { return middle_.endpoint; }
    std::vector<std::uint64_t> hashes() const {  // of the hellos
        const std::scoped_lock lock(mutex_);
        return hashes_;
    }

  private:
    mutable std::mutex mutex_;
    std::vector<std::uint64_t> hashes_;
    test::Middleman middle_;
};

TEST(ForeignUpstream, AClientOfAnotherVersionAsksInTheOriginsNumbers) {
    ForeignOrigin origin;
    OtherVersion seeming(origin.server->endpoint());
    Scene replica;
    const auto client = *MirrorClient::connect(replica, seeming.endpoint());
    const auto settle = [&] {
        return test::pollUntil(*client, [&] {
            origin.server->service();
            return client->inStep() && replica.sequence() == origin.scene.sequence();
        });
    };
    ASSERT_TRUE(settle());
    const auto refusal = [&](const Result<std::uint64_t>& asked) {
        std::string text = "none came";
        if (!asked) return asked.error().text;
        EXPECT_TRUE(test::pollUntil(*client, [&] {
            origin.server->service();
            const std::vector<MirrorVerdict> verdicts = client->takeVerdicts();
            for (const MirrorVerdict& v : verdicts) text = v.refusal;
            return !verdicts.empty();
        }));
        return text;
    };
    EXPECT_EQ(refusal(client->submitEdit(origin.box, x3d::Transform::translation.index, Vec3f(1, 2, 3))), "");
    EXPECT_EQ(origin.scene.node(origin.box).get(x3d::Transform::translation), Vec3f(1, 2, 3));
    // Nodes that it makes, with fields, a name and a route to what is there.
    const NodeId round = client->newNode();
    Change create, name, route, child;
    create.kind = ChangeKind::createNode;
    create.node = round;
    create.index = static_cast<std::uint32_t>(
        std::ranges::find(builtinTypes(), "OrientationInterpolator", [](const auto& t) { return t->name; }) -
        builtinTypes().begin());
    name.kind = ChangeKind::setName;
    name.node = round;
    name.value = String("TURN");
    route.kind = ChangeKind::addRoute;
    route.node = round;
    route.field = x3d::OrientationInterpolator::value_changed.index;
    route.other = origin.box;
    route.index = x3d::Transform::rotation.index;
    child.kind = ChangeKind::insertChild;
    child.node = origin.box;
    child.field = x3d::Transform::children.index;
    child.other = round;
    const Change key = foreignEdit(round, x3d::OrientationInterpolator::key.index, Array<float>{0.f, 1.f});
    EXPECT_EQ(refusal(client->submit({create, key, name, child, route})), "");
    const NodeId created = origin.scene.findName("TURN");
    ASSERT_TRUE(origin.scene.find(created));
    EXPECT_EQ(origin.scene.node(created).get(x3d::OrientationInterpolator::key), (Array<float>{0.f, 1.f}));
    EXPECT_EQ(origin.scene.routesTo(origin.box).size(), 1u);
    ASSERT_TRUE(settle());
    EXPECT_EQ(replica.hash(), origin.scene.hash());
    EXPECT_EQ(client->statistics().snapshots, 1u) << "it says once that its types are others, and goes on";
    const std::vector<std::uint64_t> hashes = seeming.hashes();
    ASSERT_EQ(hashes.size(), 2u);
    EXPECT_NE(hashes[0], 0u);
    EXPECT_EQ(hashes[1], 0u);
    // Nodes that the origin does not have are reported here.
    EXPECT_NE(refusal(client->submitEdit(NodeId{999}, 3, 1.f)).find("node 999"), std::string::npos);
    route.other = NodeId{999};
    EXPECT_EQ(refusal(client->submit({create, route})), "node 999 has no such field");
    create.index = static_cast<std::uint32_t>(builtinTypes().size());
    EXPECT_NE(refusal(client->submit({create})).find("prototypes"), std::string::npos);
}

/// It was written for types like ours, before anybody knew that they are others.
TEST(ForeignUpstream, WhatWasAskedBeforeTheTypesAreKnownIsRefused) {
    ForeignOrigin origin;
    OtherVersion seeming(origin.server->endpoint());
    Scene replica;
    const auto client = *MirrorClient::connect(replica, seeming.endpoint());
    ASSERT_TRUE(client->submitEdit(origin.box, x3d::Transform::translation.index, Vec3f(1, 2, 3)));
    std::vector<MirrorVerdict> verdicts;
    ASSERT_TRUE(test::pollUntil(*client, [&] {
        origin.server->service();
        verdicts = client->takeVerdicts();
        return !verdicts.empty();
    }));
    EXPECT_NE(verdicts[0].refusal.find("other node types"), std::string::npos);
    // Requests are carried out in order: by when a later one is, this one would be.
    ASSERT_TRUE(test::pollUntilAt(*client, origin.scene));
    const auto later = client->submitEdit(origin.box, x3d::Transform::scale.index, Vec3f(2));
    ASSERT_TRUE(later);
    ASSERT_TRUE(test::pollUntil(*client, [&] {
        origin.server->service();
        verdicts = client->takeVerdicts();
        return !verdicts.empty();
    }));
    EXPECT_EQ(verdicts[0].request, *later);
    EXPECT_EQ(origin.scene.node(origin.box).get(x3d::Transform::scale), Vec3f(2));
    EXPECT_EQ(origin.scene.node(origin.box).get(x3d::Transform::translation), Vec3f(0));
}

}  // namespace
}  // namespace rtsg
