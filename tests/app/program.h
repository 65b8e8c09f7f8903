// Runs the program under test as a user's shell does, with files for its streams and a deadline.
//
// Threading: one thread. A Program still running when its object goes is killed, by its process id.
#pragma once

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "support/temp_folder.h"
#include "test_paths.h"

namespace rtsg::test {

inline std::string readFile(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}
inline void writeFile(const std::filesystem::path& file, const std::string& content) {
    std::ofstream(file, std::ios::binary) << content;
}

/// A picture's file without the notes in it that say what it was made of: what is left is what one sees.
inline std::string pictureIn(const std::filesystem::path& file) {
    std::string bytes = readFile(file);
    constexpr std::size_t kSignature = 8, kFrame = 12;
    if (file.extension() != ".png") return bytes;
    for (std::size_t at = kSignature; at + kFrame <= bytes.size();) {
        std::size_t length = 0;
        for (std::size_t i = 0; i < 4; ++i) length = length << 8 | static_cast<std::uint8_t>(bytes[at + i]);
        if (bytes.compare(at + 4, 4, "iTXt") == 0)
            bytes.erase(at, length + kFrame);
        else
            at += length + kFrame;
    }
    return bytes;
}

inline std::string lastLine(const std::string& text) {
    const auto end = text.find_last_not_of('\n');
    if (end == std::string::npos) return {};
    const auto begin = text.find_last_of('\n', end);
    return text.substr(begin == std::string::npos ? 0 : begin + 1,
                       end - (begin == std::string::npos ? 0 : begin + 1) + 1);
}

/// With a clock that begins with 0, where a test says what happens when: by itself the program begins in 2000, or now.
inline std::vector<std::string> atZero(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin() + 1, {"--at", "0"});
    return arguments;
}

struct Outcome {
    int status = -1;  // of exit; 128 + n for signal n
    std::string out, err;
};

class Program {
  public:
    /// `streams`: prefix of the names of the files that standard input, output and error are kept in.
    Program(std::vector<std::string> arguments, std::string streams, const std::string& input = {})
        : streams_(std::move(streams)) {
        writeFile(streams_ + ".in", input);
        arguments.insert(arguments.begin(), RTSG_PROGRAM);
        std::vector<char*> argv;
        for (std::string& argument : arguments) argv.push_back(argument.data());
        argv.push_back(nullptr);
        pid_ = ::fork();
        if (pid_ != 0) return;
        leaveCurrentFolder();
        redirect(".in", O_RDONLY, STDIN_FILENO);
        redirect(".out", O_WRONLY | O_CREAT | O_TRUNC, STDOUT_FILENO);
        redirect(".err", O_WRONLY | O_CREAT | O_TRUNC, STDERR_FILENO);
        ::execv(argv[0], argv.data());
        ::_exit(127);
    }
    ~Program() {
        if (pid_ <= 0) return;
        ::kill(pid_, SIGKILL);
        ::waitpid(pid_, nullptr, 0);
    }
    Program(const Program&) = delete;
    Program& operator=(const Program&) = delete;

    void signal(int number) const { ::kill(pid_, number); }

    /// Reports a program that does not end, and kills it.
    Outcome wait(std::chrono::seconds deadline = std::chrono::seconds(120)) {
        const auto end = std::chrono::steady_clock::now() + deadline;
        int status = 0;
        while (::waitpid(pid_, &status, WNOHANG) == 0) {
            if (std::chrono::steady_clock::now() > end) {
                ADD_FAILURE() << "still running after " << deadline.count() << " s";
                ::kill(pid_, SIGKILL);
                ::waitpid(pid_, &status, 0);
                break;
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        pid_ = -1;
        return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), readFile(streams_ + ".out"),
                readFile(streams_ + ".err")};
    }

    /// How often its threads have waited and gone on; of those that there are now.
    std::uint64_t wakeUps() const {
        constexpr std::string_view kCount = "\nvoluntary_ctxt_switches:";
        std::uint64_t all = 0;
        std::error_code ended;
        for (const auto& thread :
             std::filesystem::directory_iterator("/proc/" + std::to_string(pid_) + "/task", ended)) {
            const std::string status = readFile(thread.path() / "status");
            if (const auto at = status.find(kCount); at != std::string::npos)
                all += std::stoull(status.substr(at + kCount.size()));
        }
        EXPECT_FALSE(ended) << "it has ended: " << said();
        return all;
    }

    /// The text on standard error so far.
    std::string said() const { return readFile(streams_ + ".err"); }
    /// The first line on standard output, once it is there.
    std::string firstLine(std::chrono::seconds deadline = std::chrono::seconds(60)) const {
        const auto end = std::chrono::steady_clock::now() + deadline;
        while (std::chrono::steady_clock::now() < end) {
            const std::string text = readFile(streams_ + ".out");
            if (const auto newline = text.find('\n'); newline != std::string::npos) return text.substr(0, newline);
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
        }
        ADD_FAILURE() << "nothing on standard output after " << deadline.count() << " s; on standard error:\n"
                      << readFile(streams_ + ".err");
        return {};
    }

  private:
    /// Files that the program makes in the current folder (pictures that differ) must not stay in the sources. Scenes
    /// may read files there, so the folder is empty.
    void leaveCurrentFolder() const {
        const std::filesystem::path empty = std::filesystem::absolute(streams_).parent_path() / "current";
        std::error_code ignored;  // it is there already
        std::filesystem::create_directory(empty, ignored);
        if (::chdir(empty.c_str()) != 0) ::_exit(126);
    }

    void redirect(const char* suffix, int flags, int to) const {
        const int from = ::open((streams_ + suffix).c_str(), flags, 0600);
        if (from < 0 || ::dup2(from, to) < 0) ::_exit(126);
        ::close(from);
    }

    std::string streams_;
    pid_t pid_ = -1;
};

/// A test of the command line: a folder, a scene in it, and the program.
class CommandLine : public testing::Test {
  protected:
    /// A box that moves from x = 0 to x = `reach` within two seconds, in a room, with a sound.
    static std::string scene(const std::string& reach = "2") {
        return R"(#X3D V4.0 utf8
PROFILE Immersive
Viewpoint { position 0 1 6 }
DEF BOX Transform {
  children [
    Shape { appearance Appearance { material Material { diffuseColor 0.8 0.3 0.2 } } geometry Box { } }
    DEF TONE Sound { location 0 3 0 source AudioClip { url "none.wav" loop TRUE } }
  ]
}
Shape { geometry Box { size 30 12 30 } }
DEF CLOCK TimeSensor { cycleInterval 2 loop TRUE }
DEF PATH PositionInterpolator { key [ 0 1 ] keyValue [ 0 0 0, )" +
               reach + R"( 0 0 ] }
DEF FLAG BooleanToggle { }
ROUTE CLOCK.fraction_changed TO PATH.set_fraction
ROUTE PATH.value_changed TO BOX.set_translation
)";
    }

    void SetUp() override { writeFile(file, scene()); }

    Outcome rtsg(std::vector<std::string> arguments, const std::string& input = {}) {
        constexpr std::string_view kRunning[] = {"run", "render", "listen", "pick", "record"};
        if (beginsAtZero && std::ranges::find(kRunning, arguments.front()) != std::end(kRunning) &&
            std::ranges::find(arguments, "--at") == arguments.end())
            arguments = atZero(std::move(arguments));
        return Program(std::move(arguments), streams(), input).wait();
    }
    std::string streams() { return folder / ("stream" + std::to_string(++programs_)); }

    bool beginsAtZero = false;  // what rtsg() runs
    TempFolder folder;
    const std::string file = folder / "scene.x3dv";

  private:
    int programs_ = 0;
};

}  // namespace rtsg::test
