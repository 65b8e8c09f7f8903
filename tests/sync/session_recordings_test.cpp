// Recorded sessions of the conformance set: the client's side is played to MirrorClient, questions are answered anew,
// and RTSG_WRITE_CONFORMANCE=FOLDER records all of them from MirrorServer (tests/sync/conformance/README.md).
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <thread>

#include <rtsg/documents/loader.h>
#include <rtsg/sync/mirror_client.h>
#include <rtsg/sync/mirror_server.h>
#include <rtsg/sync/record.h>

#include "conformance_support.h"
#include "edits/questions.h"
#include "edits/request.h"
#include "edits/upstream.h"
#include "mirror/mirror_support.h"
#include "session_recordings.h"
#include "support/log_support.h"
#include "support/temp_folder.h"
#include "test_paths.h"

namespace rtsg {
namespace {

using namespace test;
using namespace std::chrono_literals;
using mirror::Message;
namespace fs = std::filesystem;
using Steady = std::chrono::steady_clock;

// ---- recording -------------------------------------------------------------------------------------------------

/// A client that knows no more than it needs to go on, and writes down all that is said.
class Recorder {
  public:
    Recorder() : context_(zmq_ctx_new()) {}
    ~Recorder() {
        close();
        zmq_ctx_term(context_);
    }
    std::vector<Said> session{};
    /// Before the client hears a message it can be changed; false: the message is lost.
    std::function<bool(Said&)> inFlight{};
    std::size_t longestPart = SIZE_MAX;  // of a record, in one message: longer ones are divided
    mirror::Hello wishes{};

    void connect(const std::string& endpoint) {
        socket_ = zmq_socket(context_, ZMQ_DEALER);
        const int none = 0;
        zmq_setsockopt(socket_, ZMQ_LINGER, &none, sizeof(none));
        zmq_connect(socket_, endpoint.c_str());
        hello();
    }
    void cut() {
        close();
        session.push_back({Said::By::cut});
    }
    void hello() {
        mirror::Hello h = wishes;
        h.session = ++sessionNumber_;
        h.window = std::uint64_t{1} << 20;
        h.name = "recorder";
        h.wishes.client = 99;
        h.epoch = state ? epoch_ : 0;
        h.sequence = state;
        h.wishes.hash = hash_;
        received_ = 0;
        welcomed = false;
        h.write(message_);
        say(textOf(message_));
    }
    void submit(std::uint64_t request, const ByteBuffer& record) {
        const std::uint64_t numbers[] = {sessionNumber_, request, record.size(), 0};
        mirror::write(message_, Message::submit, numbers);
        say(textOf(message_), textOf(record));
    }
    void control(const std::string& text) {
        mirror::Words{sessionNumber_, text}.write(message_, Message::control);
        say(textOf(message_));
    }
    void ask(Message type, const std::function<void(ByteBuffer&)>& rest) {
        mirror::write(message_, type, {sessionNumber_});
        rest(message_);
        say(textOf(message_));
    }
    /// Messages that no server sends.
    void hearStrange(std::string first, std::string second = {}) {
        session.push_back({Said::By::server, std::move(first), std::move(second)});
    }
    bool hearUntil(MirrorServer* server, const std::function<bool()>& condition) {
        const auto end = Steady::now() + test::kPatience;
        while (!condition() && Steady::now() < end) {
            if (server) server->service();
            std::vector<std::string> parts = receiveParts(socket_, 2);
            if (!parts.empty()) hear({Said::By::server, parts[0], parts.size() > 1 ? parts[1] : std::string()});
        }
        return condition();
    }
    std::uint64_t heard(Message type) const {
        return static_cast<std::uint64_t>(
            std::ranges::count_if(session, [&](const Said& s) { return s.isBy(Said::By::server, type); }));
    }
    bool welcomed = false;
    std::uint64_t state = 0;

  private:
    void close() {
        if (socket_) zmq_close(socket_);
        socket_ = nullptr;
    }
    void say(std::string first, std::string second = {}) {
        session.push_back({Said::By::client, first, second});
        sendParts(socket_, second.empty() ? std::vector{first} : std::vector{first, second});
    }
    void hear(Said said) {
        const Message type = said.type();
        if (type == Message::data) return hearData(said);
        if (inFlight && !inFlight(said)) return;
        session.push_back(said);
        wire::Reader in = readerOf(said.first);
        (void)mirror::readPrologue(in);
        const auto number = in.number<std::uint64_t>();
        if (type == Message::welcome && number == sessionNumber_) {
            const auto epoch = in.number<std::uint64_t>();
            if (epoch != epoch_) state = 0;
            epoch_ = epoch;
            welcomed = true;
            acknowledge();
        } else if (type == Message::ping) {
            mirror::write(message_, Message::pong, {number});
            say(textOf(message_));
        } else if (type == Message::bye) {
            mirror::begin(message_, Message::bye);
            say(textOf(message_));
        }
    }
    void hearData(const Said& whole) {
        wire::Reader in = readerOf(whole.first);
        (void)mirror::readPrologue(in);
        std::uint64_t numbers[5];  // session, size, offset, clock, whether the acknowledgement can wait
        ASSERT_TRUE(mirror::read(in, numbers));
        ASSERT_EQ(numbers[1], whole.second.size()) << "records of these sessions are short";
        if (numbers[0] != sessionNumber_) return;
        for (std::size_t at = 0; at < whole.second.size(); at += longestPart) {
            numbers[2] = at;
            mirror::write(message_, Message::data, numbers);
            Said part{Said::By::server, textOf(message_), whole.second.substr(at, longestPart)};
            received_ += part.second.size();
            if (inFlight && !inFlight(part)) continue;
            session.push_back(part);
            isWhole_ = at + part.second.size() == whole.second.size();
            if (isWhole_ && part.second == whole.second.substr(at)) take(whole.second);
            acknowledge();
            if (longestPart == SIZE_MAX) break;
        }
    }
    void take(const std::string& record) {
        const auto header = checkRecord(std::as_bytes(std::span(record)));
        ASSERT_TRUE(header);
        if (header->kind == RecordKind::frame && header->from != state) return;
        state = header->to;
        hash_ = header->hash;
    }
    void acknowledge() {
        mirror::write(message_, Message::ack, {sessionNumber_, state, received_});
        say(textOf(message_));
    }

    void *context_, *socket_ = nullptr;
    ByteBuffer message_;
    std::uint64_t sessionNumber_ = 1000, epoch_ = 0, received_ = 0;
    Hash128 hash_;
    bool isWhole_ = false;
};

/// A scene that moves, and its server.
struct RecordedOrigin {
    Scene scene;
    MovingNodes motion{scene};
    std::unique_ptr<MirrorServer> server;
    int frames = 0;

    explicit RecordedOrigin(std::uint64_t epoch, Coding coding = Coding::compact, MirrorServerOptions options = {}) {
        for (int i = 0; i < 3; ++i) frame();
        options.epoch = epoch;
        options.creator = "conformance";
        options.mode.coding = coding;
        options.upstream = MirrorUpstream::edits;
        auto started = MirrorServer::start(scene, "tcp://127.0.0.1:*", options);
        EXPECT_TRUE(started) << started.error().format();
        server = std::move(*started);
    }
    void frame() {
        motion.frame(frames, true);
        scene.newFrame(frames++ / 20.0);
    }
    void follow(Recorder& recorder, int count) {
        for (int i = 0; i < count; ++i) {
            frame();
            EXPECT_TRUE(recorder.hearUntil(server.get(), [&] { return recorder.state == scene.sequence(); }));
        }
    }
    void join(Recorder& recorder) {
        recorder.connect(server->endpoint());
        EXPECT_TRUE(recorder.hearUntil(server.get(), [&] { return recorder.state == scene.sequence(); }));
    }
    void leave(Recorder& recorder) {
        std::thread end([this] { server.reset(); });
        EXPECT_TRUE(recorder.hearUntil(nullptr, [&] { return recorder.heard(Message::bye) > 0; }));
        end.join();
    }
};

void recordJoin(Recorder& recorder) {
    RecordedOrigin origin(0x5001, Coding::smallest);
    origin.join(recorder);
    origin.follow(recorder, 12);
    origin.leave(recorder);
}

void recordParts(Recorder& recorder) {
    RecordedOrigin origin(0x5002);
    recorder.longestPart = 150;
    origin.join(recorder);
    origin.follow(recorder, 4);
    origin.leave(recorder);
}

/// The connection is cut, the scene goes on, and the client has it go on from where it was.
void recordReturn(Recorder& recorder) {
    RecordedOrigin origin(0x5003);
    origin.join(recorder);
    origin.follow(recorder, 3);
    recorder.cut();
    for (int i = 0; i < 4; ++i) origin.frame();
    origin.join(recorder);
    origin.follow(recorder, 3);
    origin.leave(recorder);
}

/// The server that answers after the cut is another run, with states of the same numbers.
void recordAnotherRun(Recorder& recorder) {
    {
        RecordedOrigin origin(0x5004);
        origin.join(recorder);
        origin.follow(recorder, 3);
        recorder.cut();
    }
    RecordedOrigin other(0x5005);
    EXPECT_TRUE(other.scene.setName(other.scene.root(), "OTHER"));
    for (int i = 0; i < 8; ++i) other.frame();
    other.join(recorder);
    other.follow(recorder, 3);
    other.leave(recorder);
}

/// The client wants few frames: those between come merged.
void recordMerged(Recorder& recorder) {
    RecordedOrigin origin(0x5006);
    recorder.wishes.wishes.milliFrames = 20'000;
    origin.join(recorder);
    for (int i = 0; i < 30; ++i) {
        origin.frame();
        std::this_thread::sleep_for(7ms);
        (void)recorder.hearUntil(origin.server.get(), [] { return true; });
    }
    EXPECT_TRUE(recorder.hearUntil(origin.server.get(), [&] { return recorder.state == origin.scene.sequence(); }));
    origin.leave(recorder);
}

/// A frame is lost, then one comes with a wrong byte: each time the client says hello with the state it has.
void recordLoss(Recorder& recorder) {
    RecordedOrigin origin(0x5007);
    origin.join(recorder);
    origin.follow(recorder, 2);
    for (const bool isLost : {true, false}) {
        bool done = false;
        recorder.inFlight = [&](Said& said) {
            if (done || said.type() != Message::data) return true;
            done = true;
            said.second[said.second.size() - 2] ^= 0x10;
            return !isLost;
        };
        origin.frame();
        EXPECT_TRUE(recorder.hearUntil(origin.server.get(), [&] { return done; }));
        recorder.inFlight = nullptr;
        if (isLost) {
            const std::uint64_t messages = recorder.heard(Message::data);
            origin.frame();
            EXPECT_TRUE(
                recorder.hearUntil(origin.server.get(), [&] { return recorder.heard(Message::data) > messages; }));
        }
        recorder.hello();
        EXPECT_TRUE(recorder.hearUntil(origin.server.get(), [&] { return recorder.state == origin.scene.sequence(); }));
    }
    origin.follow(recorder, 2);
    origin.leave(recorder);
}

/// Between what counts comes what does not: other protocols, short messages, unknown types, data of other sessions.
void recordStrangeMessages(Recorder& recorder) {
    RecordedOrigin origin(0x5008);
    origin.join(recorder);
    const std::string prologue = {'R', 'T', 'S', 'G', 1};
    recorder.hearStrange("GET / HTTP/1.1");
    recorder.hearStrange("RTSG");
    recorder.hearStrange(prologue + std::string("\x63\0\0", 3) + std::string(40, 'x'));
    recorder.hearStrange(std::string("RTSG\2\x11\0\0", 8) + std::string(40, 'x'));
    origin.follow(recorder, 2);
    ByteBuffer other;
    mirror::write(other, Message::data, {1, 64, 0, 0});
    recorder.hearStrange(textOf(other), std::string(64, 'y'));
    mirror::write(other, Message::welcome, {1, 2, 500});
    recorder.hearStrange(textOf(other), std::string(64, 'z'));
    origin.follow(recorder, 2);
    mirror::write(other, Message::ping, {4711, recorder.state});
    recorder.hearStrange(textOf(other));
    origin.follow(recorder, 1);
    // The server has forgotten the client, or begun anew under the same epoch.
    mirror::begin(other, Message::unknown);
    recorder.hearStrange(textOf(other));
    recorder.hello();
    EXPECT_TRUE(recorder.hearUntil(origin.server.get(), [&] { return recorder.welcomed; }));
    origin.follow(recorder, 2);
    origin.leave(recorder);
}

void recordRefusal(Recorder& recorder) {
    RecordedOrigin origin(0x5009);
    recorder.wishes.wishes.parts = {"region:EYE"};
    recorder.connect(origin.server->endpoint());
    EXPECT_TRUE(recorder.hearUntil(origin.server.get(), [&] { return recorder.heard(Message::refused) > 0; }));
}

/// One part of the scene, by name.
void recordPart(Recorder& recorder) {
    RecordedOrigin origin(0x500a);
    const NodeId node = origin.scene.node(origin.scene.root()).get(x3d::RtsgScene::children)[2];
    EXPECT_TRUE(origin.scene.setName(node, "THING"));
    origin.frame();
    recorder.wishes.wishes.parts = {"THING"};
    origin.join(recorder);
    origin.follow(recorder, 4);
    origin.leave(recorder);
}

Change changeOf(ChangeKind kind, NodeId node) {
    Change change;
    change.kind = kind;
    change.node = node;
    return change;
}

/// An edit, a node that is created, a lock, an undo, and a request that is refused.
void recordRequests(Recorder& recorder) {
    RecordedOrigin origin(0x500b);
    const NodeId node = origin.scene.node(origin.scene.root()).get(x3d::RtsgScene::children)[0];
    EXPECT_TRUE(origin.scene.setName(node, "THING"));
    origin.frame();
    origin.join(recorder);
    ChangeEncoder encoder;
    std::uint64_t request = 0;
    const auto ask = [&](MirrorRequest asked) {
        ByteBuffer record;
        mirror::writeRequest(encoder, std::move(asked), recorder.state, record);
        recorder.submit(++request, record);
        int rounds = 0;
        const auto answered = [&] {
            if (recorder.heard(Message::verdict) < request && ++rounds % 8 == 0) origin.frame();
            return recorder.heard(Message::verdict) == request;
        };
        EXPECT_TRUE(recorder.hearUntil(origin.server.get(), answered));
    };
    Change edit = changeOf(ChangeKind::setField, node);
    edit.field = x3d::Transform::scaleOrientation.index;
    edit.value = Rotation{0, 1, 0, .5f};
    MirrorRequest moves;
    moves.changes = {edit};
    ask(moves);
    Change created = changeOf(ChangeKind::createNode, NodeId{mirror::kFirstProvisional + 5});
    created.index = x3d::Group::type.value;
    Change inserted = changeOf(ChangeKind::insertChild, node);
    inserted.field = x3d::Transform::children.index;
    inserted.other = created.node;
    MirrorRequest creates;
    creates.changes = {created, inserted};
    ask(creates);
    ask({.kind = MirrorRequest::Kind::lock, .changes = {}, .nodes = {node}, .lease = 2s});
    ask({.kind = MirrorRequest::Kind::undo, .changes = {}, .nodes = {}});
    MirrorRequest refused;
    refused.changes = {changeOf(ChangeKind::destroyNode, origin.scene.root())};
    ask(refused);
    origin.leave(recorder);
}

void recordPlaying(Recorder& recorder) {
    RecordedOrigin origin(0x500c);
    origin.server->onControl([](std::string_view command) {
        return command == "pause" ? std::string(R"({"t":1,"length":2,"state":7,"paused":true,"rate":1,"loop":false})")
                                  : "refused: no such command";
    });
    origin.join(recorder);
    for (const char* command : {"pause", "fly"}) {
        const std::uint64_t before = recorder.heard(Message::reply);
        recorder.control(command);
        EXPECT_TRUE(recorder.hearUntil(origin.server.get(), [&] { return recorder.heard(Message::reply) > before; }));
    }
    origin.follow(recorder, 1);
    origin.leave(recorder);
}

/// The questions of a client that has found another hash: first about ranges, then about nodes, at last for the values.
void recordQuestions(Recorder& recorder) {
    RecordedOrigin origin(0x500d);
    const NodeId node = origin.scene.node(origin.scene.root()).get(x3d::RtsgScene::children)[3];
    origin.join(recorder);
    origin.follow(recorder, 2);
    const auto answered = [&](Message type, std::uint64_t count) {
        EXPECT_TRUE(recorder.hearUntil(origin.server.get(), [&] { return recorder.heard(type) == count; }));
    };
    recorder.ask(Message::doubt, [](ByteBuffer& out) { out.putVarint(0); });
    answered(Message::digest, 1);
    recorder.ask(Message::doubt, [](ByteBuffer& out) {
        for (const std::uint64_t n : {2, 0, 2, 8, 3}) out.putVarint(n);
    });
    answered(Message::digest, 2);
    recorder.ask(Message::inspect, [&](ByteBuffer& out) {
        for (const std::uint64_t n : {std::uint64_t{2}, std::uint64_t{node.value}, std::uint64_t{4000}})
            out.putVarint(n);
    });
    answered(Message::anatomy, 1);
    const std::uint64_t records = recorder.heard(Message::data);
    recorder.ask(Message::want, [&](ByteBuffer& out) {
        const std::uint64_t field = x3d::Transform::translation.index;
        for (const std::uint64_t n : {std::uint64_t{1}, std::uint64_t{node.value}, field}) out.putVarint(n);
    });
    answered(Message::data, records + 1);
    origin.follow(recorder, 2);
    origin.leave(recorder);
}

const std::pair<const char*, void (*)(Recorder&)> kSessions[] = {{"join", recordJoin},
                                                                 {"parts", recordParts},
                                                                 {"return", recordReturn},
                                                                 {"another_run", recordAnotherRun},
                                                                 {"merged", recordMerged},
                                                                 {"loss", recordLoss},
                                                                 {"strange", recordStrangeMessages},
                                                                 {"refusal", recordRefusal},
                                                                 {"part", recordPart},
                                                                 {"requests", recordRequests},
                                                                 {"playing", recordPlaying},
                                                                 {"questions", recordQuestions}};

// ---- playing ---------------------------------------------------------------------------------------------------

/// The reactions of a client under test to a recorded session, as JSON.
class Player {
  public:
    explicit Player(const std::vector<Said>& session) : context_(zmq_ctx_new()) {
        bind("tcp://127.0.0.1:*");
        char bound[256];
        std::size_t length = sizeof(bound);
        zmq_getsockopt(socket_, ZMQ_LAST_ENDPOINT, bound, &length);
        endpoint_ = bound;
        attachment_ = replica_.bus().attach(listening_);
        MirrorClientOptions options;
        options.maxLag = 0ms;
        options.scrub = 0ms;
        options.timeout = 2 * test::kPatience;  // the recording says nothing for as long as this process is held up
        client_ = std::move(*MirrorClient::connect(replica_, endpoint_, options));
        for (const Said& said : session) play(said);
        const auto says = [&](Message what) {
            return std::ranges::any_of(session, [what](const Said& s) { return s.isBy(Said::By::server, what); });
        };
        if (says(Message::bye)) wait([&] { return client_->serverLeft(); });
        if (says(Message::refused)) wait([&] { return !refused_.empty(); });
        hear();
    }
    ~Player() {
        close();
        client_.reset();
        zmq_ctx_term(context_);
    }
    Player(const Player&) = delete;
    Player& operator=(const Player&) = delete;
    std::string result() const {
        return fmt::format(
            "{{\"states\":[{}],\n\"hellos\":[{}],\n\"verdicts\":[{}],\n\"replies\":[{}],\n\"refused\":{},"
            "\"left\":{},\n\"last\":{}}}\n",
            listening_.states, hellos_, verdicts_, replies_, jsonText(refused_),
            client_->serverLeft() ? "true" : "false", dumpOf(replica_));
    }
    const Scene& replica() const { return replica_; }
    bool failed = false;
    /// The recording is of a program with other node types: it describes those of its requests.
    bool describes = false;

  private:
    struct Listening : Subscriber {
        std::string states;
        std::uint64_t newest = 0;
        Result<> apply(const Scene& scene, const ChangeSet&) override {
            if (scene.sequence() == 0 || scene.sequence() == newest) return {};  // before the first; a repair
            newest = scene.sequence();
            states += fmt::format("{}[{},\"{}\"]", states.empty() ? "" : ",", newest, scene.hash().hex());
            return {};
        }
    };
    void bind(const char* endpoint) {
        socket_ = zmq_socket(context_, ZMQ_ROUTER);
        const int none = 0;
        zmq_setsockopt(socket_, ZMQ_LINGER, &none, sizeof(none));
        while (zmq_bind(socket_, endpoint) != 0) std::this_thread::sleep_for(5ms);
    }
    void close() {
        if (socket_) zmq_close(socket_);
        socket_ = nullptr;
    }
    static constexpr auto kHelloLost = 2s;  // then a client says a hello again that has no answer
    /// Reads the client's messages since the last call.
    void hear() {
        client_->poll(1ms);
        for (const MirrorVerdict& v : client_->takeVerdicts()) report(v);
        for (const std::string& reply : client_->takeReplies()) add(replies_, jsonText(reply));
        if (refused_.empty()) refused_ = client_->refusal();
        for (auto parts = receiveParts(socket_, 0); !parts.empty(); parts = receiveParts(socket_, 0)) {
            wire::Reader in = readerOf(parts.at(1));
            const auto type = mirror::readPrologue(in);
            mirror::Hello hello;
            if (type == Message::hello && hello.read(in)) {
                peer_ = parts[0];
                sessionNumber_ = hello.session;
                if (hello.dictionaryHash == 0) {  // before its first request; it is in the state that it was in
                    describes = true;
                    say(welcome_);
                    continue;
                }
                const bool again = greeted_ && Steady::now() - *greeted_ >= kHelloLost;
                greeted_ = Steady::now();
                if (again) continue;
                ++said_;
                add(hellos_, fmt::format("[{},{}]", hello.epoch, hello.sequence));
            }
        }
    }
    static void add(std::string& list, const std::string& item) { list += (list.empty() ? "" : ",") + item; }
    void report(const MirrorVerdict& v) {
        std::string created;
        for (const auto& [wanted, built] : v.created) add(created, fmt::format("{}", built.value));
        add(verdicts_, fmt::format("{{\"request\":{},\"state\":{},\"refusal\":{},\"created\":[{}],\"kept\":{}}}",
                                   v.request, v.state, jsonText(v.refusal), created, jsonText(v.kept)));
    }
    void wait(const std::function<bool()>& condition) {
        const auto end = Steady::now() + test::kPatience;
        while (!failed && !condition()) {
            hear();
            failed = Steady::now() > end;
        }
    }
    void play(const Said& said) {
        if (failed) return;
        const bool isClient = said.by == Said::By::client;
        if (said.by == Said::By::cut) {
            close();
            bind(endpoint_.c_str());
        } else if (isClient && said.type() == Message::hello) {
            ++expected_;
            wait([&] { return said_ >= expected_; });
        } else if (isClient && said.type() == Message::ack) {
            // One after the other, as it was: the client has come to this state before the server goes on.
            wire::Reader in = readerOf(said.first);
            (void)mirror::readPrologue(in);
            std::uint64_t numbers[3];  // session, state, bytes
            ASSERT_TRUE(mirror::read(in, numbers));
            wait([&] { return numbers[1] == 0 || listening_.newest == numbers[1]; });
        } else if (isClient && said.type() == Message::submit) {
            // The message is its own, the number is that of the recorded one.
            EXPECT_TRUE(client_->undo());
            // A client of other types has ended its session to say hello again. It ignores what the last session says.
            wait([&] { return describes || !ofOtherTypes_; });
        } else if (isClient && said.type() == Message::control) {
            wire::Reader in = readerOf(said.first);
            (void)mirror::readPrologue(in);
            mirror::Words words;
            EXPECT_TRUE(words.readControl(in));
            EXPECT_TRUE(client_->control(words.text));
        } else if (!isClient) {
            say(said);
        }
    }
    void say(Said said) {
        if (said.type() == Message::welcome) {
            welcome_ = said;
            greeted_.reset();
            const auto head = decodeHead(std::as_bytes(std::span(said.second)));
            ofOtherTypes_ = head && head->dictionaryHash != ChangeDecoder(builtinTypes()).localHash();
        }
        const bool ofSession = said.type() >= Message::welcome && said.type() != Message::unknown &&
                               said.type() != Message::refused && said.first.size() >= 16;
        std::uint64_t number = 0;
        if (ofSession) std::memcpy(&number, said.first.data() + 8, 8);
        if (number >= 1000) std::memcpy(said.first.data() + 8, &sessionNumber_, 8);  // others are of no session
        sendParts(socket_,
                  said.second.empty() ? std::vector{peer_, said.first} : std::vector{peer_, said.first, said.second});
        hear();
    }

    void *context_, *socket_ = nullptr;
    std::string endpoint_, peer_;
    Scene replica_;
    Listening listening_;
    Attachment attachment_;
    std::unique_ptr<MirrorClient> client_;
    std::uint64_t sessionNumber_ = 0;
    Said welcome_;
    bool ofOtherTypes_ = false;                  // as the welcome says
    std::optional<Steady::time_point> greeted_;  // when the client said hello that has no answer yet
    int said_ = 0, expected_ = 0;
    std::string hellos_, verdicts_, replies_, refused_;
};

// ---- the tests -------------------------------------------------------------------------------------------------

const fs::path kFolder = RTSG_SOURCE_DIR "/tests/sync/conformance/mirror";

TEST(SessionRecordings, CanBeMade) {
    const char* given = std::getenv("RTSG_WRITE_CONFORMANCE");
    const TempFolder unkept;
    const fs::path folder = given ? fs::path(given) / "mirror" : unkept.path();
    fs::create_directories(folder);
    for (const auto& [name, record] : kSessions) {
        SCOPED_TRACE(name);
        Recorder recorder;
        record(recorder);
        writeSession(folder / (std::string(name) + ".session"), recorder.session);
        const Player player(recorder.session);
        EXPECT_FALSE(player.failed) << "the client does not say what it should";
        EXPECT_FALSE(player.describes);
        EXPECT_EQ(player.result().contains("{\"request\":5,"), std::string(name) == "requests");
        if (!given) continue;
        writeAll(folder / (std::string(name) + ".json"), player.result());
    }
}

/// Plays the session until the result is the expected one, three times at most: a client that is held up for seconds
/// says hello again by itself, which the recording does not have. Returns whether it described its types.
bool expectFollowed(const std::vector<Said>& session, const std::string& expected) {
    for (int attempt = 1;; ++attempt) {
        const Player player(session);
        if (attempt < 3 && (player.failed || player.result() != expected)) continue;
        EXPECT_FALSE(player.failed) << "the client does not say what it should";
        EXPECT_EQ(player.result(), expected);
        return player.describes;
    }
}

TEST(SessionRecordings, AreFollowedAsExpected) {
    std::size_t sessions = 0;
    for (const auto& [name, record] : kSessions) {
        SCOPED_TRACE(name);
        ++sessions;
        const std::vector<Said> session = readSession(kFolder / (std::string(name) + ".session"));
        ASSERT_GT(session.size(), 1u);
        const std::string expected = readAll(kFolder / (std::string(name) + ".json"));
        expectFollowed(session, expected);
    }
    EXPECT_EQ(sessions, std::size(kSessions));
}

TEST(SessionRecordings, OfAnotherVersionAreFollowedWithTheSameVerdicts) {
    std::vector<Said> session = readSession(kFolder / "requests.session");
    for (Said& said : session)
        if (said.isBy(Said::By::server, Message::welcome)) said.second = test::withOtherTypes(said.second);
    const std::string expected = readAll(kFolder / "requests.json");
    EXPECT_TRUE(expectFollowed(session, expected));
}

/// The server's answers about hashes are those that anybody in the same state gives.
TEST(SessionRecordings, QuestionsHaveTheAnswersOfTheirState) {
    const std::vector<Said> session = readSession(kFolder / "questions.session");
    std::vector<Said> before;
    int questions = 0;
    for (std::size_t i = 0; i < session.size(); ++i) {
        const bool isDoubt = session[i].isBy(Said::By::client, Message::doubt);
        if (isDoubt || session[i].isBy(Said::By::client, Message::inspect)) {
            const Player player(before);
            ASSERT_FALSE(player.failed) << "the client does not say what it should";
            wire::Reader in = readerOf(session[i].first);
            (void)mirror::readPrologue(in);
            const auto number = in.number<std::uint64_t>();
            ByteBuffer answer;
            EXPECT_TRUE(isDoubt ? mirror::answerDoubt(player.replica(), number, in, answer)
                                : mirror::answerInspect(player.replica(), number, in, answer));
            EXPECT_EQ(asHex(textOf(answer)), asHex(session.at(i + 1).first));
            ++questions;
        }
        before.push_back(session[i]);
    }
    EXPECT_EQ(questions, 3);
}

}  // namespace
}  // namespace rtsg
