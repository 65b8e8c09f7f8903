// RTSG_HEAP_IS_OURS: whether a test program may replace malloc or operator new to count. Sanitizers have theirs.
#pragma once

#if defined(__has_feature)
#define RTSG_HAS(feature) __has_feature(feature)
#else
#define RTSG_HAS(feature) 0
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || RTSG_HAS(address_sanitizer) || \
    RTSG_HAS(thread_sanitizer)
#define RTSG_HEAP_IS_OURS 0
#else
#define RTSG_HEAP_IS_OURS 1
#endif
