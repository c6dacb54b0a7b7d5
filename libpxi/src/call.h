// A function that is called through a pointer, of which it is not told more than what it takes.
#pragma once

#include <concepts>
#include <type_traits>

namespace pxi {

template <class Signature> class Call;

// Refers to something that can be called, which must live as long as this; std::function is several times as much code.
template <class Result, class... Given> class Call<Result(Given...)> {
    void *self;
    Result (*function)(void *, Given...);

  public:
    template <class Work>
        requires(!std::same_as<std::remove_cvref_t<Work>, Call>)
    Call(Work &&work)
        : self((void *)&work), function([](void *self, Given... given) -> Result {
              return (*(std::remove_reference_t<Work> *)self)(given...);
          }) {}
    Result operator()(Given... given) const { return function(self, given...); }
};

}  // namespace pxi
