"""What multimedia tells its users: words in `remarks.toml`, in English, Italian and German."""

from photocore.remarks import Remarks

remark = Remarks("photocore", "multimedia")
in_language = remark.in_language
