// Memory of an instance, and mathematics of the host: less code than the C library's, as every byte is sent.
#include <cstddef>
#include <cstdint>
#include <new>

#include "../src/errors.h"

#define IMPORTED(name) __attribute__((import_module("pxi"), import_name(name)))

extern "C" {
IMPORTED("exp") double pxi_exp(double);
IMPORTED("exp2") double pxi_exp2(double);
IMPORTED("log") double pxi_log(double);
double exp(double x) { return pxi_exp(x); }
double exp2(double x) { return pxi_exp2(x); }
double log(double x) { return pxi_log(x); }

// Single instructions.
void *memcpy(void *to, const void *from, size_t n) { return __builtin_memcpy(to, from, n); }
void *memmove(void *to, const void *from, size_t n) { return __builtin_memmove(to, from, n); }
void *memset(void *to, int value, size_t n) { return __builtin_memset(to, value, n); }

// Only memory that ends, or a vector that is larger than any, aborts.
void abort() { pxi::out_of_memory(); }

extern char __heap_base;
}

namespace {

constexpr size_t HEAD = 16, SMALL = 512, PAGE = 1 << 16;

struct Block {
    size_t size;  // of what follows the head, a multiple of 16
    Block *next;  // while it is free
    char *end() { return (char *)this + HEAD + size; }
};
static Block *small[SMALL / HEAD + 1];  // free blocks of each size
static Block *large;                    // free blocks by their address, which join their neighbours
static char *top = &__heap_base;

// A block of memory that was never used.
Block *fresh(size_t size) {
    Block *block = (Block *)(((uintptr_t)top + HEAD - 1) / HEAD * HEAD);
    const uint64_t end = (uint64_t)(uintptr_t)block + HEAD + size, held = (uint64_t)__builtin_wasm_memory_size(0) * PAGE;
    if (end > UINT32_MAX) return nullptr;
    if (end > held && __builtin_wasm_memory_grow(0, (size_t)((end - held + PAGE - 1) / PAGE)) == (size_t)-1)
        return nullptr;
    block->size = size;
    top = block->end();
    return block;
}

// The first free block that is large enough; what it has too much stays.
Block *found(size_t size) {
    for (Block **at = &large; *at; at = &(*at)->next) {
        Block *block = *at;
        if (block->size < size) continue;
        if (block->size - size < SMALL) {
            *at = block->next;
            return block;
        }
        Block *rest = (Block *)((char *)block + HEAD + size);
        rest->size = block->size - size - HEAD, rest->next = block->next;
        block->size = size;
        *at = rest;
        return block;
    }
    return nullptr;
}

void put_back(Block *block) {
    Block *before = nullptr, *after = large;
    while (after && after < block) before = after, after = after->next;
    block->next = after;
    (before ? before->next : large) = block;
    if (after && block->end() == (char *)after) block->size += HEAD + after->size, block->next = after->next;
    if (before && before->end() == (char *)block) before->size += HEAD + block->size, before->next = block->next;
}

}  // namespace

extern "C" void *malloc(size_t wanted) {
    if (wanted > PTRDIFF_MAX) return nullptr;
    const size_t size = ((wanted ? wanted : 1) + HEAD - 1) / HEAD * HEAD;
    Block *block = nullptr;
    if (size <= SMALL) {
        Block *&list = small[size / HEAD];
        if ((block = list)) list = block->next;
    } else {
        block = found(size);
    }
    if (!block && !(block = fresh(size))) return nullptr;
    return (char *)block + HEAD;
}

extern "C" void free(void *room) {
    if (!room) return;
    Block *block = (Block *)((char *)room - HEAD);
    if (block->size > SMALL) return put_back(block);
    block->next = small[block->size / HEAD];
    small[block->size / HEAD] = block;
}

extern "C" void *calloc(size_t count, size_t each) {
    size_t size;
    void *room = __builtin_mul_overflow(count, each, &size) ? nullptr : malloc(size);
    return room ? memset(room, 0, size) : nullptr;
}

void *operator new(size_t wanted) {
    if (void *room = malloc(wanted)) return room;
    pxi::out_of_memory();
}
void *operator new[](size_t wanted) { return operator new(wanted); }
void *operator new(size_t wanted, const std::nothrow_t &) noexcept { return malloc(wanted); }
void *operator new[](size_t wanted, const std::nothrow_t &) noexcept { return malloc(wanted); }
void *operator new(size_t wanted, std::align_val_t) { return operator new(wanted); }  // of vectors: HEAD bytes
void *operator new[](size_t wanted, std::align_val_t) { return operator new(wanted); }
void operator delete(void *room) noexcept { free(room); }
void operator delete(void *room, std::align_val_t) noexcept { free(room); }
void operator delete[](void *room, std::align_val_t) noexcept { free(room); }
void operator delete[](void *room) noexcept { free(room); }
void operator delete(void *room, size_t) noexcept { free(room); }
void operator delete[](void *room, size_t) noexcept { free(room); }
