"""Pronunciations of words that no dictionary has, by the spelling rules of espeak-ng (the extra `espeak`)."""

import ctypes
from functools import cache

from gesture_bot.base.errors import GestureBotError, InvalidValueError

ARPABET = {
    "ɑː": "AA", "ɔ": "AO", "ɔː": "AO", "æ": "AE", "a": "AE", "ʌ": "AH", "ə": "AH", "ɐ": "AH",
    "ɛ": "EH", "e": "EH", "ɚ": "ER", "ɜː": "ER", "ɪ": "IH", "ᵻ": "IH", "i": "IY", "iː": "IY",
    "ʊ": "UH", "uː": "UW", "u": "UW", "aɪ": "AY", "aʊ": "AW", "eɪ": "EY", "oʊ": "OW", "ɔɪ": "OY",
    "əl": "AH L", "n̩": "AH N", "iə": "IY AH", "aɪə": "AY AH", "aɪɚ": "AY ER", "ɑːɹ": "AA R",
    "ɔːɹ": "AO R", "oːɹ": "AO R", "ɛɹ": "EH R", "ɪɹ": "IH R", "ʊɹ": "UH R", "b": "B", "d": "D",
    "f": "F", "ɡ": "G", "h": "HH", "j": "Y", "k": "K", "l": "L", "ɬ": "L", "m": "M", "n": "N",
    "ŋ": "NG", "p": "P", "r": "R", "ɹ": "R", "s": "S", "t": "T", "ɾ": "T", "ʔ": "T", "v": "V",
    "w": "W", "x": "K", "z": "Z", "ð": "DH", "θ": "TH", "ʃ": "SH", "ʒ": "ZH", "dʒ": "JH",
    "tʃ": "CH",
}  # fmt: skip
"""What espeak-ng's American voice writes in IPA, in the phones of the CMU dictionary."""

_SEPARATOR = "_"
_UTF8, _IPA = 1, 0x02 | ord(_SEPARATOR) << 8
_SYNCHRONOUS = 2


def pronounce(word: str) -> str:
    """How an English word is probably said, as CMU phones with single spaces, such as `R OW B AA T`.

    Raises:
        GestureBotError: The extra `espeak` is not installed.
        InvalidValueError: The word has a sound that CMU's phones lack, or none at all.
    """
    text = ctypes.c_char_p(word.encode())
    said: bytes = _espeak().espeak_TextToPhonemes(ctypes.byref(text), _UTF8, _IPA) or b""
    symbols = said.decode().translate(dict.fromkeys(map(ord, "ˈˌ "))).split(_SEPARATOR)
    symbols = [symbol for symbol in symbols if symbol]
    unknown = [symbol for symbol in symbols if symbol not in ARPABET]
    if unknown or not symbols:
        raise InvalidValueError(f"cannot tell how {word!r} is said in English", "".join(symbols) or word)
    return " ".join(ARPABET[symbol] for symbol in symbols)


@cache
def _espeak() -> ctypes.CDLL:
    try:
        import espeakng_loader
    except ImportError:
        raise GestureBotError("needs espeak-ng: pip install 'gesture-bot[espeak]'") from None
    library = ctypes.CDLL(espeakng_loader.get_library_path())
    library.espeak_TextToPhonemes.restype = ctypes.c_char_p
    if library.espeak_Initialize(_SYNCHRONOUS, 0, espeakng_loader.get_data_path().encode(), 0) < 0:
        raise GestureBotError("espeak-ng does not find its data in", espeakng_loader.get_data_path())
    library.espeak_SetVoiceByName(b"en-us")
    return library
