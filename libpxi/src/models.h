// Registered models of the pyramid coder (PYR-35 to PYR-37): their weights are no part of a file.
#pragma once

#include <memory>
#include <vector>

#include "model.h"

namespace pxi {

struct Context {  // weights of the context network of a level, [out][in].., integers in units of 2**exponent
    std::vector<int32_t> first, first_bias, first_by_step, second, second_bias, causal, mix, mix_bias, luma,
        luma_bias, from_luma, from_luma_bias, chroma, chroma_bias;
    int first_exponent, second_exponent, causal_exponent, mix_exponent, luma_exponent, from_luma_exponent,
        chroma_exponent;
};
struct Synthetic {  // weights of the synthesis network of a level
    std::vector<float> linear;  // [12][12][5][5] of the wavelet, with what the model adds (PYR-32)
    std::vector<float> gain, gain_by_step, first, first_bias, first_by_step, second, second_bias, third, third_bias;
};

constexpr int LEVEL_SETS = 4;  // networks for levels 1, 2, 3, and for all coarser ones

struct Weights {
    int hidden, context;  // hidden units of the synthesis and of the context networks
    std::vector<float> to_colour;  // [3][3]
    Context contexts[LEVEL_SETS];
    Synthetic syntheses[LEVEL_SETS];
    const Context &context_of(int level) const { return contexts[std::min(level, LEVEL_SETS) - 1]; }
    const Synthetic &synthesis_of(int level) const { return syntheses[std::min(level, LEVEL_SETS) - 1]; }
};

// Finds the bytes of a model's file by its name, as `model` of pxi_options does.
struct FindModel {
    int (*function)(void *context, const char *file, const void **bytes, size_t *count) = nullptr;
    void *context = nullptr;
};

class Models {
    static constexpr int FILES = 1;
    FindModel find;
    std::unique_ptr<Weights> loaded[FILES];

  public:
    // Without a function, the models that are built into the library.
    explicit Models(FindModel find = {}) : find(find) {}
    static bool registered(int number);
    static bool padded(int number);  // whether planes are those of a raster padded to multiples of 2**levels
    const Weights &of(int number);   // loads what is registered
};

}  // namespace pxi
