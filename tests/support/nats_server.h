// A nats-server on loopback with a folder of its own, for tests; ended with its object.
//
// Threading: one thread.
#pragma once

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "support/temp_folder.h"

namespace rtsg::test {

class NatsServer {
  public:
    /// Where the program is; empty if it is not installed.
    static std::string program() {
        for (const char* folder : {"/usr/sbin", "/usr/bin", "/usr/local/bin"})
            if (const std::string file = std::string(folder) + "/nats-server"; ::access(file.c_str(), X_OK) == 0)
                return file;
        return {};
    }
    static constexpr const char* kMissing = "nats-server is not installed (package nats-server)";

    /// `settings` are lines of its configuration; `store` what stands in its block of JetStream.
    explicit NatsServer(const std::string& settings = {}, const std::string& store = {}) : port_(freePort()) {
        std::ofstream(folder_ / "nats.conf")
            << "listen: 127.0.0.1:" << port_ << "\njetstream {\n store_dir: \"" << (folder_ / "store") << "\"\n"
            << store << "\n}\n"
            << settings << "\n";
        start();
    }
    ~NatsServer() { stop(); }
    NatsServer(const NatsServer&) = delete;
    NatsServer& operator=(const NatsServer&) = delete;

    /// At the same port, with what it has stored.
    void start() {
        const std::string file = program(), configuration = folder_ / "nats.conf", log = folder_ / "nats.log";
        pid_ = ::fork();
        if (pid_ == 0) {
            ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // a test that crashes leaves none behind
            const int out = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
            ::dup2(out, STDOUT_FILENO);
            ::dup2(out, STDERR_FILENO);
            ::execl(file.c_str(), file.c_str(), "-c", configuration.c_str(), nullptr);
            ::_exit(127);
        }
        const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
        while (!answers() && std::chrono::steady_clock::now() < end)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        if (answers()) return;
        std::ifstream said(log);
        throw std::runtime_error("nats-server does not answer: " +
                                 std::string(std::istreambuf_iterator<char>(said), std::istreambuf_iterator<char>()));
    }
    void stop(int signal = SIGTERM) {
        if (pid_ <= 0) return;
        ::kill(pid_, signal);
        ::waitpid(pid_, nullptr, 0);
        pid_ = -1;
    }
    int port() const { return port_; }
    pid_t process() const { return pid_; }
    std::string address(const std::string& name = "hall", const std::string& secret = {}) const {
        return "nats://" + secret + "127.0.0.1:" + std::to_string(port_) + "/" + name;
    }

    /// A socket that is connected to that port of this machine, or bound to it; -1 if that fails.
    static int connected(int port, bool listens) {
        const int descriptor = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
        sockaddr_in address{};
        address.sin_family = AF_INET;
        address.sin_port = htons(static_cast<std::uint16_t>(port));
        address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        const auto* at = reinterpret_cast<const sockaddr*>(&address);
        if ((listens ? ::bind(descriptor, at, sizeof(address)) : ::connect(descriptor, at, sizeof(address))) == 0)
            return descriptor;
        ::close(descriptor);
        return -1;
    }
    static int freePort() {
        const int descriptor = connected(0, true);
        sockaddr_in address{};
        socklen_t size = sizeof(address);
        ::getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size);
        ::close(descriptor);
        return ntohs(address.sin_port);
    }

  private:
    bool answers() const {
        const int descriptor = connected(port_, false);
        char first = 0;
        const bool ok = descriptor >= 0 && ::recv(descriptor, &first, 1, 0) == 1;  // it begins with INFO
        if (descriptor >= 0) ::close(descriptor);
        return ok;
    }

    TempFolder folder_;
    const int port_;
    pid_t pid_ = -1;
};

}  // namespace rtsg::test
