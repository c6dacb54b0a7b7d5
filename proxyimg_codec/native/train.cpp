// The function of the core that trains implicit textures. Its results need not be the same on all
// levels, so it is compiled for speed; decoding needs nothing of it.

#include "level.h"
#include "train.h"

#pragma GCC visibility push(default)
extern "C" {

// Takes `steps` steps of training; `pixels` is [steps][batch]. Returns their mean loss.
double PXI(train)(const Train *task, const int32_t *pixels, int64_t steps, int64_t batch, int64_t done,
                 const float *lr_codes, const float *lr_weights) {
    return Training(*task, {pixels, steps, batch, done, lr_codes, lr_weights}).run();
}

}  // extern "C"
