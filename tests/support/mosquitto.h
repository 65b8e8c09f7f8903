// A mosquitto on loopback with a folder of its own, for tests and benches; ended with its object.
//
// Threading: one thread.
#pragma once

#include <chrono>
#include <csignal>
#include <fstream>
#include <string>
#include <thread>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "support/nats_server.h"
#include "support/temp_folder.h"

namespace rtsg::test {

class Mosquitto {
  public:
    /// Where the program is; empty if it is not installed.
    static std::string program() {
        for (const char* folder : {"/usr/sbin", "/usr/local/sbin", "/usr/bin"})
            if (const std::string file = std::string(folder) + "/mosquitto"; ::access(file.c_str(), X_OK) == 0)
                return file;
        return {};
    }
    static constexpr const char* kMissing = "mosquitto is not installed (package mosquitto)";

    /// `settings` are lines of its configuration. Waits until it takes connections.
    explicit Mosquitto(const std::string& settings = "allow_anonymous true\n") : port_(NatsServer::freePort()) {
        const std::string file = program(), configuration = folder_ / "broker.conf";
        // The user of the service could not read what tests write.
        std::ofstream(configuration) << "user root\nlistener " << port_ << " 127.0.0.1\n" << settings;
        pid_ = ::fork();
        if (pid_ == 0) {
            ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // a test that crashes leaves none behind
            const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC);
            ::dup2(nowhere, STDOUT_FILENO);
            ::dup2(nowhere, STDERR_FILENO);
            ::execl(file.c_str(), file.c_str(), "-c", configuration.c_str(), nullptr);
            ::_exit(127);
        }
        for (int i = 0; i < 3000; ++i) {
            const int attempt = NatsServer::connected(port_, false);
            if (attempt >= 0) {
                ::close(attempt);
                break;
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(20));
        }
    }
    ~Mosquitto() { stop(); }
    Mosquitto(const Mosquitto&) = delete;
    Mosquitto& operator=(const Mosquitto&) = delete;

    void stop() {
        if (pid_ <= 0) return;
        ::kill(pid_, SIGKILL);
        ::waitpid(pid_, nullptr, 0);
        pid_ = -1;
    }
    /// "mqtt://127.0.0.1:1883/" and the topic.
    std::string endpoint(const std::string& topic) const {
        return "mqtt://127.0.0.1:" + std::to_string(port_) + "/" + topic;
    }

  private:
    TempFolder folder_;
    const int port_;
    pid_t pid_ = -1;
};

}  // namespace rtsg::test
