// Everything numeric that is compiled more than once, for different instruction sets, lives in an inline
// namespace that carries the instruction set's name: otherwise the linker keeps one copy of each template,
// and which one it keeps is chance (a silent wrong answer when a file compiled for AVX2 meets one that is
// not).
#pragma once

#ifndef RHYTID_ISA
#define RHYTID_ISA isa_baseline
#endif
