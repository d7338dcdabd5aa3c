"""What the detection refuses."""


class DetectionError(Exception):
    """Base of what the detection raises. The text says what was found, what is expected, and what to do.

    DetectionError
    |-- RuntimeMissing      onnxruntime is not installed, or has not the device that was asked for
    |-- ModelUnreadable     no such file, or not an ONNX model
    |-- ModelForeign        an ONNX model, but not of a layout that is known here
    `-- InferenceFailed     the runtime gave up on an image
    """


class RuntimeMissing(DetectionError):
    """onnxruntime is not installed, or has not the device that was asked for."""


class ModelUnreadable(DetectionError):
    """No such file, or not an ONNX model."""


class ModelForeign(DetectionError):
    """An ONNX model, but not of a layout that is known here."""


class InferenceFailed(DetectionError):
    """The runtime gave up on an image."""
