// --set DEF.field=VALUE@TIME: events that come into a scene from outside while it runs.
#pragma once

#include <string>
#include <vector>

#include "cli.h"

namespace rtsg::app {

class Injections {
  public:
    /// The scene must outlive this. Errors name what is wrong with one of `texts`.
    static Result<Injections> parse(Scene& scene, const std::vector<std::string>& texts);
    struct Injection {
        double time = 0;  // seconds
        FieldRef target;
        Value value;
        bool isNow = false;  // the value is the scene's time when it is sent
    };
    /// The next one that is due at `t`, each once; null when none is.
    const Injection* next(double t);
    /// Queues those that are due for the frame at `t`, which is `start` later on the scene's clock; what the scene
    /// refuses goes to standard error.
    void sendUntil(double t, double start);

  private:
    static Result<Injection> parseOne(const Scene& scene, const std::string& text);

    Scene* scene_ = nullptr;
    std::vector<Injection> all_;
    std::size_t next_ = 0;
};

}  // namespace rtsg::app
