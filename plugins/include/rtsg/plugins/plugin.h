// What a plug-in is made with: a shared library with one exported function, which RTSG_PLUGIN writes.
//
// Its file says with which headers it was compiled: C++ interfaces of others would not fit, so loadPlugin() compares
// them before it loads the file. Threading and what may be registered: extensions.h.
#pragma once

#include <rtsg/plugins/extensions.h>
#include <rtsg/plugins/interface.h>

namespace rtsg {

/// What a plug-in's function returns.
struct PluginEntry {
    const char* interface;  // that it was compiled with
    /// Adds what the plug-in has. After an exception, or an error of what it returns, nothing of it is added.
    Result<> (*add)(Extensions& extensions);
};

// Of these the standard library's types have another layout or other names.
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
