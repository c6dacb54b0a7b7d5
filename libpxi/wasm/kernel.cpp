// The loops of native/kernel.cpp. Those that seldom run are compiled to be small, as every byte is sent.
#pragma clang attribute push(__attribute__((minsize)), apply_to = function)
#include "native/arrays.h"
#include "native/completion.h"
#include "native/coverage.h"
#include "native/diffusion.h"
#pragma clang attribute pop

#include "native/kernel.cpp"
