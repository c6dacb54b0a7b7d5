// Names of what one level exports: the same source is compiled once for each level of processors
// (setup.py), into one library, and levels.cpp tells which of them a processor runs.
#pragma once

#ifndef PXI_LEVEL  // a build of a single level
#define PXI_LEVEL baseline
#endif

#define PXI_JOINED(name, level) pxi_##name##_##level
#define PXI_NAMED(name, level) PXI_JOINED(name, level)
#define PXI(name) PXI_NAMED(name, PXI_LEVEL)
