// A display for tests: the one there is, or an Xvfb of their own.
#pragma once

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>
#include <cstdlib>
#include <string>

namespace rtsg::test {

/// Whether there is a display. If DISPLAY names none and Xvfb is installed, one is started, which ends with the
/// process.
inline bool haveDisplay() {
    static const bool have = [] {
        if (const char* name = std::getenv("DISPLAY"); name && *name) return true;
        int ends[2];
        if (::pipe(ends) != 0) return false;
        const ::pid_t child = ::fork();
        if (child == 0) {
            ::close(ends[0]);
            ::prctl(PR_SET_PDEATHSIG, SIGTERM);  // whatever becomes of the test
            // It tells of each display that is taken.
            if (const int nowhere = ::open("/dev/null", O_WRONLY); nowhere >= 0) ::dup2(nowhere, STDERR_FILENO);
            const std::string number = std::to_string(ends[1]);
            ::execlp("Xvfb", "Xvfb", "-noreset", "-displayfd", number.c_str(), "-screen", "0", "640x480x24",
                     "-nolisten", "tcp", static_cast<char*>(nullptr));
            ::_exit(127);
        }
        ::close(ends[1]);
        std::string name;
        char c = 0;
        while (::read(ends[0], &c, 1) == 1 && c != '\n') name += c;
        ::close(ends[0]);
        if (child < 0 || name.empty()) return false;
        static const ::pid_t server = child;
        std::atexit([] {
            ::kill(server, SIGTERM);
            ::waitpid(server, nullptr, 0);
        });
        ::setenv("DISPLAY", (":" + name).c_str(), 1);
        return true;
    }();
    return have;
}

}  // namespace rtsg::test
