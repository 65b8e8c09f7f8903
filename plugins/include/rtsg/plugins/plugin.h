// The interface of plug-ins: a plug-in is a shared library with one exported function, which RTSG_PLUGIN defines.
//
// A plug-in's file contains a number of the headers that it was compiled with. loadPlugin() compares it before it loads
// the file, since C++ interfaces of other headers would not fit. Threading and additions: extensions.h.
#pragma once

#include <rtsg/plugins/extensions.h>
#include <rtsg/plugins/interface.h>

namespace rtsg {

/// The result of a plug-in's function.
struct PluginEntry {
    const char* interface;  // the plug-in was compiled with this one
    /// Adds the extensions of the plug-in. If it throws or returns an error, nothing is added.
    Result<> (*add)(Extensions& extensions);
};

// With these the standard library's types have another layout or other names.
#if defined _LIBCPP_VERSION
#define RTSG_PLUGIN_LIBRARY ", libc++"
#elif defined _GLIBCXX_DEBUG
#define RTSG_PLUGIN_LIBRARY ", _GLIBCXX_DEBUG"
#else
#define RTSG_PLUGIN_LIBRARY ""
#endif
/// The version, and a number that follows from the headers. The loader looks for it in a plug-in's file, from the first
/// word to the 0 at the end.
#define RTSG_PLUGIN_INTERFACE "RTSG plug-in interface " RTSG_PLUGIN_HEADERS RTSG_PLUGIN_LIBRARY

/// The function's name.
constexpr const char* kPluginFunction = "rtsg_plugin";

}  // namespace rtsg

/// Defines the one function of a plug-in:
/// `RTSG_PLUGIN(extensions) { return extensions.add(workshop::nodeTypes()); }`
#define RTSG_PLUGIN(extensions)                                                                  \
    static ::rtsg::Result<> rtsgAddExtensions(::rtsg::Extensions&);                              \
    extern "C" __attribute__((visibility("default"))) const ::rtsg::PluginEntry* rtsg_plugin();  \
    extern "C" __attribute__((visibility("default"))) const ::rtsg::PluginEntry* rtsg_plugin() { \
        static constexpr ::rtsg::PluginEntry entry{RTSG_PLUGIN_INTERFACE, rtsgAddExtensions};    \
        return &entry;                                                                           \
    }                                                                                            \
    static ::rtsg::Result<> rtsgAddExtensions(::rtsg::Extensions& extensions)
