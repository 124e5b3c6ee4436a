// What the shared library shows of itself, and the version of it that programs are built against.
#pragma once

/// Counts up when a program built against an older version may not run with this one; the library's SOVERSION.
#define DCCD_API_VERSION 1

#define DCCD_EXPORT __attribute__((visibility("default")))
/// For what is declared within an exported class, which otherwise shows it, too.
#define DCCD_HIDDEN __attribute__((visibility("hidden")))
