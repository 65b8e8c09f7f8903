// Every verb that writes a log, with every store and every way of dividing it: what is accepted is whole, and what is
// refused is refused before anything is written. Each row of the table in docs/sessions.md is what is found here; with
// RTSG_SESSIONS_TABLE=FILE the rows are added to that file.
#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <optional>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "program.h"
#include "support/nats_server.h"

namespace rtsg::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

using Words = std::vector<std::string>;

Words operator+(Words a, const Words& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

class LogStores : public CommandLine {
  protected:
    LogStores() { beginsAtZero = true; }
    void SetUp() override {
        CommandLine::SetUp();
        ASSERT_EQ(rtsg({"record", file, "-o", source, "--for", "1s", "--fps", "20"}).status, 0);
        if (NatsServer::program().empty()) return;
        nats = std::make_unique<NatsServer>();
        if (rtsg({"info", nats->address("none")}).err.find("leaves it out") != std::string::npos) nats.reset();
    }

    enum class Store { file, folder, files, pipe, nats };
    static constexpr Store kStores[] = {Store::file, Store::folder, Store::files, Store::pipe, Store::nats};

    /// A target of this kind in a folder of its own: what to write to, and what then to read.
    struct Target {
        std::string written, read;
        std::unique_ptr<Program> reader;  // of a pipe
    };
    std::optional<Target> target(Store store, bool there) {
        const std::string own = folder / ("t" + std::to_string(++targets_));
        std::filesystem::create_directory(own);
        const auto copy = [&](const std::string& name) {
            if (there) std::filesystem::copy_file(source, name);
            return name;
        };
        switch (store) {
            case Store::file:
                return Target{copy(own + "/a.rlog"), own, {}};
            case Store::folder:
                copy(own + "/a.rlog");
                return Target{own, own, {}};
            case Store::files:
                return Target{copy(own + "/a.0001.rlog") + "," + copy(own + "/a.rlog"), own, {}};
            case Store::pipe: {
                const std::string pipe = own + "/pipe.rlog";
                EXPECT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
                return Target{pipe, own + "/read.rlog", {}};
            }
            case Store::nats:
                break;
        }
        if (!nats) return std::nullopt;
        const std::string address = nats->address("t" + std::to_string(targets_));
        if (there) {
            EXPECT_EQ(rtsg({"record", file, "-o", address, "--for", "1s", "--fps", "20"}).status, 0);
        }
        return Target{address, address, {}};
    }

    /// What is there, byte by byte.
    std::string contentOf(const Target& target) {
        if (target.written.starts_with("nats:")) return rtsg({"info", target.written}).out;
        std::string all;
        const std::filesystem::path written = target.written.substr(0, target.written.find(','));
        for (const auto& entry : std::filesystem::directory_iterator(
                 std::filesystem::is_directory(written) ? written : written.parent_path()))
            if (entry.is_regular_file()) all += entry.path().filename().string() + readFile(entry.path());
        return all;
    }

    /// A verb with one use of a log.
    struct Use {
        const char* name;
        Words before, after;  // around the target
        bool needsLog = false;
        std::vector<Words> dividing{{}};
        bool pipes = true;  // what is made of logs is no stream, and replaces no pipe
    };
    void walk(const Use& use) {
        for (const Words& more : use.dividing) {
            std::string row = std::string("| `") + use.name;
            for (const std::string& word : more) row += " " + word;
            row += "` |";
            for (const Store store : kStores) {
                const auto created = target(store, use.needsLog);
                if (created && (store != Store::pipe || (use.pipes && !use.needsLog)))
                    row += write(use, more, store, *created) ? " whole |" : " refused |";
                else if (created)
                    row += " |";
            }
            compareWithTable(row);
        }
    }
    /// False: it was refused.
    bool write(const Use& use, const Words& more, Store store, const Target& to) {
        const std::string before = contentOf(to);
        SCOPED_TRACE(std::string(use.name) + " " + to.written + " " + testing::PrintToString(more));
        std::thread reader;
        std::atomic<bool> isRead = false;
        if (store == Store::pipe)
            reader = std::thread([&] {
                writeFile(to.read, readFile(to.written));
                isRead = true;
            });
        const Outcome outcome = rtsg(use.before + Words{to.written} + use.after + more);
        if (reader.joinable()) {
            while (!isRead) {  // lets a reader go to whom nothing was written
                if (const int end = ::open(to.written.c_str(), O_WRONLY | O_NONBLOCK); end >= 0) ::close(end);
                std::this_thread::sleep_for(std::chrono::milliseconds(5));
            }
            reader.join();
        }
        if (outcome.status == 2) {
            ++refused_;
            EXPECT_NE(outcome.err, "");
            if (store != Store::pipe) {
                EXPECT_EQ(contentOf(to), before);
            }
            return false;
        }
        ++accepted_;
        EXPECT_EQ(outcome.status, 0) << outcome.err;
        expectWhole(to, outcome, std::ranges::find(more, "lossy") != more.end());
        return true;
    }
    /// Without a NATS server the row lacks its last column.
    static void compareWithTable(const std::string& row) {
        if (const char* const to = std::getenv("RTSG_SESSIONS_TABLE")) std::ofstream(to, std::ios::app) << row << '\n';
        EXPECT_THAT(readFile(std::string(RTSG_SOURCE_DIR) + "/docs/sessions.md"), HasSubstr("\n" + row));
    }
    void expectWhole(const Target& created, const Outcome& outcome, bool isLossy) {
        const Outcome read = rtsg({"replay", created.read, "--verify", "--json"});
        EXPECT_EQ(read.status, 0) << read.err;
        if (read.out.empty()) return;
        const json states = json::parse(lastLine(read.out));
        EXPECT_EQ(states.at("gaps"), 0) << states;
        EXPECT_EQ(states.at("damaged"), 0) << states;
        EXPECT_EQ(states.at("frames"), states.at("verified")) << states;
        const std::string last = lastLine(outcome.out);
        const json said = last.starts_with('{') ? json::parse(last) : json();
        if (said.contains("hash") && !isLossy) {  // else it is the scene's, whose values the log rounds
            EXPECT_EQ(said.at("hash"), states.at("hash"));
        }
    }

    const std::string source = folder / "source.rlog";
    std::unique_ptr<NatsServer> nats;
    int targets_ = 0, accepted_ = 0, refused_ = 0;
};

const std::vector<Words> kDividing{
    {}, {"--rotate", "250ms"}, {"--keep", "1MB"}, {"--rotate", "250ms", "--keep", "10s"}};

TEST_F(LogStores, RecordedLogsAreWholeOrRefused) {
    std::vector<Words> kinds;
    for (const Words& kind :
         {Words{}, {"--mode", "input"}, {"--inputs"}, {"--mode", "lossy"}, {"--keyframe-seconds", "0.1"}})
        for (const Words& divided : {kDividing[0], kDividing[1]}) kinds.push_back(kind + divided);
    kinds.insert(kinds.end(), {kDividing[2], kDividing[3]});
    walk({"record -o", {"record", file, "-o"}, {"--for", "1s", "--fps", "20", "--json"}, false, kinds});
    EXPECT_EQ(accepted_, nats ? 22 : 17);
    EXPECT_EQ(refused_, nats ? 38 : 31);
}

TEST_F(LogStores, ServedAndTouchedLogsAreWholeOrRefused) {
    walk({"serve --record",
          {"serve", file, "--record"},
          {"--for", "0.6s", "--linger", "0s", "--json"},
          false,
          kDividing});
    walk({"touch --record",
          {"touch", std::string(RTSG_SOURCE_DIR) + "/examples/touch.x3dv", "--device",
           std::string("sim:") + RTSG_SOURCE_DIR + "/examples/knock.csv", "--record"},
          {"--json"}});
}

TEST_F(LogStores, MirroredLogsAreWholeOrRefused) {
    Program server({"serve", file, "--json", "--for", "120s"}, streams());
    const std::string endpoint = json::parse(server.firstLine()).at("endpoint");
    walk({"mirror --record", {"mirror", endpoint, "--record"}, {"--for", "0.5s", "--json"}});
}

TEST_F(LogStores, LogsMadeOfLogsAreWholeOrRefused) {
    walk({"replay --compact", {"replay", source, "--compact"}, {"--every", "3"}, false, {{}}, false});
    walk({"replay --without -o", {"replay", source, "--without", "BOX.*", "-o"}, {}, false, {{}}, false});
    walk({"merge -o", {"merge", source, source, "-o"}, {}, false, {{}}, false});
}

TEST_F(LogStores, ContinuedLogsAreWholeOrRefused) {
    walk({"serve --resume", {"serve", "--resume"}, {"--for", "0.6s", "--linger", "0s", "--json"}, true, kDividing});
    walk({"replay --rerun --update", {"replay"}, {"--rerun", file, "--update"}, true});
}

TEST_F(LogStores, ReadersTakeStoredLogsAsFiles) {
    if (!nats) GTEST_SKIP() << NatsServer::kMissing;
    const std::string address = nats->address("stored"), secret = nats->address("stored");
    ASSERT_EQ(rtsg({"replay", source, "--compact", address}).status, 0);
    const Outcome same = rtsg({"diff", source, address});
    EXPECT_EQ(same.status, 0) << same.err;
    EXPECT_THAT(same.out, HasSubstr(source + " and " + address + " are equal"));
    EXPECT_EQ(rtsg({"merge", source, address, "-o", folder / "both.rlog"}).status, 0);
    ASSERT_EQ(rtsg({"record", file, "-o", folder / "other.rlog", "--for", "1s", "--fps", "10"}).status, 0);
    for (const Words& arguments : {Words{"replay", address, "--diff", folder / "other.rlog"},
                                   {"replay", folder / "other.rlog", "--diff", address},
                                   {"diff", folder / "other.rlog", address},
                                   {"replay", address, "--seek", "9s"},
                                   {"diff", source, nats->address("nothing")},
                                   {"diff", source, folder / "missing.rlog"}}) {
        const Outcome outcome = rtsg(arguments);
        EXPECT_EQ(outcome.status, 1) << testing::PrintToString(arguments);
        EXPECT_EQ(outcome.err.find("/rtsg-nats-"), std::string::npos) << outcome.err;
        EXPECT_EQ(outcome.out.find("/rtsg-nats-"), std::string::npos) << outcome.out;
    }
    EXPECT_THAT(rtsg({"diff", source, nats->address("nothing")}).err, HasSubstr("no session is stored there"));
    EXPECT_THAT(rtsg({"diff", source, folder / "missing.x3dv"}).err, HasSubstr("there is no such file"));
}

/// A session that is replaced stays until the new one has a record.
TEST_F(LogStores, AVerbThatFailsBeforeItBeginsReplacesNothing) {
    if (!nats) GTEST_SKIP() << NatsServer::kMissing;
    const std::string address = nats->address("kept");
    ASSERT_EQ(rtsg({"replay", source, "--compact", address}).status, 0);
    EXPECT_EQ(rtsg({"record", folder / "none.x3dv", "-o", address, "--force"}).status, 1);
    EXPECT_EQ(rtsg({"record", file, "-o", address, "--force", "--set", "none"}).status, 2);
    EXPECT_EQ(rtsg({"diff", source, address}).status, 0);
}

}  // namespace
}  // namespace rtsg::test
