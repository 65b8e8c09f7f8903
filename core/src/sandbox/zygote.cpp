// The small process that forks workers, and ends them.
#include <cerrno>
#include <csignal>
#include <cstring>

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "messages.h"

namespace rtsg::sandbox {

namespace {

constexpr int kSocket = 3;

/// Leaves of all descriptors the socket alone, as number 3. Libraries may write to the standard ones.
void keepOnly(int socket) {
    if (socket != kSocket) ::dup2(socket, kSocket);
    ::close_range(kSocket + 1, ~0U, 0);
    const int nothing = ::open("/dev/null", O_RDWR | O_CLOEXEC);
    if (nothing < 0) return;
    ::dup2(nothing, STDIN_FILENO);
    ::dup2(nothing, STDOUT_FILENO);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    ::dup2(nothing, STDERR_FILENO);
#endif
    ::close(nothing);
}

/// What a terminal or a service manager sends to all processes of the program is for the first one; the others end with
/// it. What a fault sends has its effect.
void setSignals() {
    for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGCHLD, SIGSYS})
        std::signal(signal, SIG_DFL);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE, SIGUSR1, SIGUSR2}) std::signal(signal, SIG_IGN);
}

bool receiveOrder(Order& order, int (&descriptors)[2]) {
    descriptors[0] = descriptors[1] = -1;
    iovec part{&order, sizeof(order)};
    alignas(cmsghdr) char space[CMSG_SPACE(sizeof(descriptors))];
    msghdr message{};
    message.msg_iov = &part, message.msg_iovlen = 1;
    message.msg_control = space, message.msg_controllen = sizeof(space);
    ssize_t got = -1;
    do {
        got = ::recvmsg(kSocket, &message, MSG_CMSG_CLOEXEC);
    } while (got < 0 && errno == EINTR);
    if (const cmsghdr* with = CMSG_FIRSTHDR(&message);
        with && with->cmsg_type == SCM_RIGHTS && with->cmsg_len == CMSG_LEN(sizeof(descriptors)))
        std::memcpy(descriptors, CMSG_DATA(with), sizeof(descriptors));
    return got == static_cast<ssize_t>(sizeof(order));
}

OrderAnswer carryOut(const Order& order, const int (&descriptors)[2]) {
    OrderAnswer answer;
    if (order.ends != 0) {
        answer.pid = order.pid;
        ::kill(order.pid, SIGKILL);  // one that has ended keeps its status
        while (::waitpid(order.pid, &answer.status, 0) < 0 && errno == EINTR) {
        }
        return answer;
    }
    if (libraryOf(reinterpret_cast<const void*>(order.task.serve)) != order.library) {
        answer.problem = -1;
        return answer;
    }
    const pid_t zygote = ::getpid();
    const pid_t child = ::fork();
    if (child == 0) {
        ::prctl(PR_SET_PDEATHSIG, SIGKILL);
        if (::getppid() != zygote) ::_exit(1);  // it has ended before
        ::dup2(descriptors[0], kSocket);
        ::close(descriptors[0]);
        runWorker(kSocket, descriptors[1], order);
    }
    answer.pid = child > 0 ? child : 0;
    answer.problem = child > 0 ? 0 : errno;
    return answer;
}

}  // namespace

// It ends when the last end of its socket is closed, so with its parent. PR_SET_PDEATHSIG would end it with the thread
// that started it.
void runZygote(int socket) {
    keepOnly(socket);
    setSignals();
    Order order;
    int descriptors[2];
    while (receiveOrder(order, descriptors)) {
        const OrderAnswer answer = carryOut(order, descriptors);
        for (const int descriptor : descriptors)
            if (descriptor >= 0) ::close(descriptor);
        if (::send(kSocket, &answer, sizeof(answer), MSG_NOSIGNAL) != static_cast<ssize_t>(sizeof(answer))) break;
    }
    ::_exit(0);
}

}  // namespace rtsg::sandbox
