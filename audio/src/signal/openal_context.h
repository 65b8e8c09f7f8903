// OpenAL's current context, for the calls of one scope, on one thread only.
//
// Needs ALC_EXT_thread_local_context. Threading: as the context's owner.
#pragma once

#define AL_ALEXT_PROTOTYPES
#include <AL/al.h>
#include <AL/alc.h>
#include <AL/alext.h>

namespace rtsg {

/// Makes a context the thread's current one, and puts back the one before.
class BoundContext {
  public:
    explicit BoundContext(ALCcontext* context) : before_(alcGetThreadContext()) { alcSetThreadContext(context); }
    ~BoundContext() { alcSetThreadContext(before_); }
    BoundContext(const BoundContext&) = delete;
    BoundContext& operator=(const BoundContext&) = delete;

  private:
    ALCcontext* before_;
};

}  // namespace rtsg
